"""Textured models of a published block: GLB and 3D Tiles."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from catalogs.features import file_stem
from tasks.progress import advance, begin_stage
from tasks.published.opened import Published


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


def write_3dtiles(found: Published, buildings: np.ndarray, folder: Path) -> tuple[list[str], list[str]]:
    """tileset.json and its tiles, on the earth."""
    from dataclasses import replace

    from facade_core.export.earth import earth_frame
    from facade_core.export.models import local_frame, part_of
    from facade_core.export.shells import simplified_shells
    from facade_core.export.tiles import COARSE, count_tiles, quadtree, write_tileset

    source = found.textured
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
    begin_stage("export", len(buildings) + count_tiles(cells))
    shells = simplified_shells(source, density * COARSE, lambda: advance("export", 1))
    (folder / "tiles").mkdir()

    def write(uri: str, data: bytes) -> None:
        (folder / uri).write_bytes(data)
        advance("export", 1)

    tileset = write_tileset(
        source,
        cells,
        shells,
        earth_frame(found.crs, local_frame(source.mesh).origin, separation or 0.0),
        found.names,
        density,
        write,
        extras=extras,
        attribution=found.attribution,
    )
    (folder / "tileset.json").write_text(json.dumps(tileset, indent=1, allow_nan=False) + "\n")
    return ["tileset.json"], notes
