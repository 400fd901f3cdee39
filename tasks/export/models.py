"""Textured models of a published block: GLB and 3D Tiles."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from catalogs.features import file_stem
from tasks.progress import advance, begin_stage
from tasks.published.opened import Published

# How pictures of 3D Tiles are encoded where nothing else is asked for: every client reads it.
TEXTURES = "jpeg"
# Beside a tileset: what all of its tiles take together.
FIGURES = "figures.json"


def with_ground(found: Published, buildings: np.ndarray) -> np.ndarray:
    """The buildings, and the ground (-1) where they are all there are."""
    return np.append(buildings, -1) if len(buildings) == len(found.choose(())) else buildings


def write_models(found: Published, buildings: np.ndarray, folder: Path) -> tuple[list[str], list[str]]:
    """block.glb with a node per building, and buildings/ID.glb each, all in the block's local frame (extras: origin, crs)."""
    from facade_core.export.glb import glb_bytes
    from facade_core.export.models import jpegs, layout_of, local_frame, nodes_of

    source = found.textured
    frame = local_frame(found.plan.scene.mesh)
    extras = {"origin": frame.origin.tolist(), "crs": found.crs}
    (folder / "buildings").mkdir()
    begin_stage("export", len(buildings) + 1)

    def write(path: Path, shown: np.ndarray) -> None:
        drawn = layout_of(source, source.chosen(shown))
        nodes, _ = nodes_of([drawn], found.names, frame)
        path.write_bytes(glb_bytes(nodes, jpegs(drawn), extras=extras, copyright=found.attribution.line))
        advance("export", 1)

    for building in buildings.tolist():
        write(folder / "buildings" / f"{file_stem(found.names[building])}.glb", np.array([building]))
    write(folder / "block.glb", with_ground(found, buildings))
    return ["block.glb"], []


def write_3dtiles(
    found: Published,
    buildings: np.ndarray,
    folder: Path,
    *,
    textures: str = TEXTURES,
    max_texture_mb: float | None = None,
) -> tuple[list[str], list[str]]:
    """tileset.json and its tiles, on the earth, whose parts answer with the catalogue's columns."""
    from dataclasses import replace

    from facade_core.export.cells import COARSE, quadtree
    from facade_core.export.earth import earth_frame
    from facade_core.export.encoders import MIPMAPS, encoder
    from facade_core.export.models import local_frame, part_of
    from facade_core.export.shells import simplified_shells
    from facade_core.export.tiles import count_tiles, scale_of_view, write_tileset
    from tasks.export.features import features_of

    source, encoded = found.textured, encoder(textures)
    shown = np.isin(source.charts.building[source.mesh.chart], with_ground(found, buildings))
    source = replace(source, mesh=part_of(source.mesh, shown))
    density = found.plan.scene.spec.texels_per_metre
    separation = found.group.attrs.get("geoid_separation")
    extras = {"block": found.block, "crs": found.crs, "snapshot": found.snapshot.id}
    notes = []
    if separation is None:
        extras["heights"] = (
            "the block's own, as given: without geoid_separation in the block file they may not be over the ellipsoid"
        )
        notes = [
            "heights are the block's own, and 3D Tiles count them from the ellipsoid: the model may stand tens of metres too "
            "high or too low; write the geoid's height there as geoid_separation (metres) in the block file and run it again"
        ]
    else:
        extras["heights"] = f"over the ellipsoid: {separation} m added to the block's"
    cells = quadtree(source)
    scale = 1.0 if max_texture_mb is None else scale_of_view(source, cells, encoded, max_texture_mb * 1e6)
    if scale < 1:
        notes.append(
            f"textures have {scale:.2f} of the texels per metre, so that a view of them takes {max_texture_mb:g} MB at most"
        )
    begin_stage("export", len(buildings) + count_tiles(cells))
    shells = simplified_shells(source, density * COARSE, lambda: advance("export", 1))
    for name in ("tiles", "tilesets"):
        (folder / name).mkdir()

    def write(uri: str, data: bytes) -> None:
        (folder / uri).write_bytes(data)
        advance("export", 1)

    tiled = write_tileset(
        source,
        cells,
        shells,
        earth_frame(found.crs, local_frame(source.mesh).origin, separation or 0.0),
        features_of(found),
        encoded,
        write,
        scale=scale,
        extras=extras,
        attribution=found.attribution,
    )
    for name, value in tiled.tilesets.items():
        (folder / name).write_text(json.dumps(value, indent=1, allow_nan=False) + "\n")
    told = {
        "draw_calls": tiled.draws,
        "bytes": tiled.bytes,
        "texture_mb": round(tiled.texels * encoded.texel_bytes * MIPMAPS / 1e6, 1),
        "texels_used": round(tiled.used / max(tiled.texels, 1), 4),
        "scale": round(scale, 4),
    }
    (folder / FIGURES).write_text(json.dumps(told, indent=1) + "\n")
    return ["tileset.json"], notes
