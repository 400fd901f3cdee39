"""Textured models of a published block: GLB and 3D Tiles."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catalogs.features import file_stem
from facade_core.core.errors import InputError
from tasks.engine.progress import advance, begin_stage
from tasks.export.earth import on_earth
from tasks.published.opened import Published

if TYPE_CHECKING:
    from facade_core.export.models.gltf_materials import Time
    from facade_core.export.models.textured_mesh import Textured

# How pictures of 3D Tiles are encoded where nothing else is asked for: every client reads it.
TEXTURES = "jpeg"
# What --textures says of a model whose facades are of types and tiling materials.
FACTORED = "factored"
# Beside a tileset: what all of its tiles take together.
FIGURES = "figures.json"


def shown(found: Published, lit: bool | None, night: bool, *, lit_by_default: bool) -> tuple[Textured, list[str]]:
    """What models of a block show, lit or as it is, and what there is to say of that. Raises InputError where a night is asked
    for of what is not lit."""
    from facade_core.export.lighting.relighting import relit
    from tasks.export.lighting import lighting, mostly_photographed

    asked = lit
    if lit is None:
        lit = (lit_by_default or night) and (night or not mostly_photographed(found))
    if not lit:
        if night:
            raise InputError("--night: is of what is lit; leave --no-lit out")
        whose = "its textures are the source's own photographs: models show them unlit; --lit has them lit all the same"
        return found.textured, [whose] if asked is None and lit_by_default else []
    return relit(found.textured, lighting(found)), []


def with_ground(found: Published, buildings: np.ndarray) -> np.ndarray:
    """The buildings, and the ground (-1) where they are all there are."""
    return np.append(buildings, -1) if len(buildings) == len(found.choose(())) else buildings


def write_models(
    found: Published,
    buildings: np.ndarray,
    folder: Path,
    *,
    textures: str | None = None,
    lit: bool | None = None,
    night: bool = False,
) -> tuple[list[str], list[str]]:
    """block.glb with a node per building, and buildings/ID.glb each, all in the block's local frame (extras: origin, crs); with
    any `textures` block.glb alone, factored."""
    if textures is not None:
        from tasks.export.factored import write_factored

        return write_factored(found, buildings, with_ground(found, buildings), folder)
    from facade_core.export.models.encoders import ENCODERS
    from facade_core.export.models.glb import glb_bytes
    from facade_core.export.models.gltf_materials import look_of
    from facade_core.export.models.textured_mesh import layout_of, local_frame, nodes_of, page_pictures

    source, notes = shown(found, lit, night, lit_by_default=True)
    frame = local_frame(found.plan.scene.mesh)
    extras = {"origin": frame.origin.tolist(), "crs": found.crs}
    (folder / "buildings").mkdir()
    begin_stage("export", len(buildings) + 1)

    def write(path: Path, those: np.ndarray) -> None:
        drawn = layout_of(source, source.chosen(those))
        nodes, _ = nodes_of([drawn], found.names, frame)
        pages = range(len(drawn.layout.pages))
        looks = [look_of(page_pictures(drawn, page), ENCODERS["jpeg"]) for page in pages]
        time: Time = "night or day" if night else "day or night"
        named = found.attribution.line
        path.write_bytes(glb_bytes(nodes, looks, extras=extras, copyright=named, time=time))
        advance("export", 1)

    for building in buildings.tolist():
        write(folder / "buildings" / f"{file_stem(found.names[building])}.glb", np.array([building]))
    write(folder / "block.glb", with_ground(found, buildings))
    return ["block.glb"], notes


def write_3dtiles(
    found: Published,
    buildings: np.ndarray,
    folder: Path,
    *,
    textures: str = TEXTURES,
    max_texture_mb: float | None = None,
    lit: bool | None = None,
    night: bool = False,
) -> tuple[list[str], list[str]]:
    """tileset.json and its tiles, on the earth, whose parts answer with the catalogue's columns."""
    if textures == FACTORED:
        from tasks.export.factored import write_factored_tiles

        return write_factored_tiles(found, buildings, with_ground(found, buildings), folder)
    from dataclasses import replace

    from facade_core.export.models.encoders import MIPMAP_FACTOR, texture_encoder
    from facade_core.export.models.gltf_materials import texels_held
    from facade_core.export.models.textured_mesh import local_frame, part_of
    from facade_core.export.tiles.cells import COARSE, quadtree
    from facade_core.export.tiles.far_shells import simplified_shells
    from facade_core.export.tiles.tileset import count_tiles, scale_of_view, write_tileset
    from tasks.export.features import features_of

    encoded = texture_encoder(textures)
    source, notes = shown(found, lit, night, lit_by_default=False)
    chosen = np.isin(source.charts.building[source.mesh.chart], with_ground(found, buildings))
    source = replace(source, mesh=part_of(source.mesh, chosen))
    density = found.plan.scene.spec.texels_per_metre
    frame, extras, said = on_earth(found, local_frame(source.mesh).origin)
    notes += said
    cells = quadtree(source)
    time: Time = "night" if night else "day"
    begin_stage("export", len(buildings) + count_tiles(cells))
    shells = simplified_shells(source, density * COARSE, lambda: advance("export", 1))
    most = encoded.max_view_mb if max_texture_mb is None else max_texture_mb
    scale = scale_of_view(source, shells, cells, encoded, most * 1e6, time)
    if scale < 1:
        notes.append(
            f"textures have {scale:.2f} of the texels per metre, so that a view of them takes {most:g} MB of a graphics card "
            "at most; --max-texture-mb inf keeps all"
        )
    for name in ("tiles", "tilesets"):
        (folder / name).mkdir()

    def write(uri: str, data: bytes) -> None:
        (folder / uri).write_bytes(data)
        advance("export", 1)

    tiled = write_tileset(
        source,
        cells,
        shells,
        frame,
        features_of(found),
        encoded,
        write,
        scale=scale,
        time=time,
        extras=extras,
        attribution=found.attribution,
    )
    for name, value in tiled.tilesets.items():
        (folder / name).write_text(json.dumps(value, indent=1, allow_nan=False) + "\n")
    held = texels_held(source.maps is not None, time)
    told = {
        "draw_calls": tiled.draws,
        "bytes": tiled.bytes,
        "texture_mb": round(tiled.texels * held * encoded.bytes_per_texel * MIPMAP_FACTOR / 1e6, 1),
        "texels_used": round(tiled.used / max(tiled.texels, 1), 4),
        "scale": round(scale, 4),
    }
    (folder / FIGURES).write_text(json.dumps(told, indent=1) + "\n")
    return ["tileset.json"], notes
