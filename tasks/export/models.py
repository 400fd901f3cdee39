"""Textured models of a published block: GLB and 3D Tiles."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catalogs.features import file_stem
from facade_core.core.errors import InputError
from tasks.engine.progress import begin_stage, report_progress
from tasks.export.earth import on_earth
from tasks.publish.opened import Published

if TYPE_CHECKING:
    from facade_core.export.models.gltf_materials import TimeOfDay
    from facade_core.export.models.textured_mesh import TexturedMesh

# How pictures of 3D Tiles are encoded where nothing else is asked for: every client reads it.
TEXTURES = "jpeg"
# What --textures says of a model whose facades are of types and tiling materials.
FACTORED = "factored"
# Beside a tileset: what all of its tiles take together.
FIGURES = "figures.json"


def shown(found: Published, lit: bool | None, night: bool, *, lit_by_default: bool) -> tuple[TexturedMesh, list[str]]:
    """What models of a block show, lit or as it is, and what there is to say of that. Raises InputError where a night is asked
    for of what is not lit."""
    from facade_core.export.lighting.relighting import relight
    from tasks.export.lighting import lighting, mostly_photographed

    asked = lit
    if lit is None:
        lit = (lit_by_default or night) and (night or not mostly_photographed(found))
    if not lit:
        if night:
            raise InputError("--night: is of what is lit; leave --no-lit out")
        whose = "its textures are the source's own photographs: models show them unlit; --lit has them lit all the same"
        return found.textured, [whose] if asked is None and lit_by_default else []
    return relight(found.textured, lighting(found)), []


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
    from facade_core.export.models.glb import encode_glb
    from facade_core.export.models.gltf_materials import encode_textures
    from facade_core.export.models.textured_mesh import build_nodes, draw_page_images, local_frame, pack_charts

    source, notes = shown(found, lit, night, lit_by_default=True)
    frame = local_frame(found.plan.scene.mesh)
    extras = {"origin": frame.origin.tolist(), "crs": found.crs}
    (folder / "buildings").mkdir()
    begin_stage("export", len(buildings) + 1)

    def write(path: Path, those: np.ndarray) -> None:
        drawn = pack_charts(source, source.select_charts(those))
        nodes, _ = build_nodes([drawn], found.names, frame)
        pages = range(len(drawn.layout.pages))
        looks = [encode_textures(draw_page_images(drawn, page), ENCODERS["jpeg"]) for page in pages]
        time: TimeOfDay = "night or day" if night else "day or night"
        named = found.attribution.line
        path.write_bytes(encode_glb(nodes, looks, extras=extras, copyright=named, time=time))
        report_progress("export", 1)

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
    from facade_core.export.models.gltf_materials import relative_texel_count
    from facade_core.export.models.textured_mesh import filter_triangles, local_frame
    from facade_core.export.tiles.cells import COARSE_SCALE, build_quadtree
    from facade_core.export.tiles.far_shells import build_shells
    from facade_core.export.tiles.tileset import count_tiles, view_scale, write_tileset
    from tasks.export.features import features_of

    encoded = texture_encoder(textures)
    source, notes = shown(found, lit, night, lit_by_default=False)
    chosen = np.isin(source.charts.building[source.mesh.chart], with_ground(found, buildings))
    source = replace(source, mesh=filter_triangles(source.mesh, chosen))
    density = found.plan.scene.spec.texels_per_metre
    frame, extras, said = on_earth(found, local_frame(source.mesh).origin)
    notes += said
    cells = build_quadtree(source)
    time: TimeOfDay = "night" if night else "day"
    begin_stage("export", len(buildings) + count_tiles(cells))
    shells = build_shells(source, density * COARSE_SCALE, lambda: report_progress("export", 1))
    most = encoded.max_view_mb if max_texture_mb is None else max_texture_mb
    scale = view_scale(source, shells, cells, encoded, most * 1e6, time)
    if scale < 1:
        notes.append(
            f"textures have {scale:.2f} of the texels per metre, so that a view of them takes {most:g} MB of a graphics card "
            "at most; --max-texture-mb inf keeps all"
        )
    for name in ("tiles", "tilesets"):
        (folder / name).mkdir()

    def write(uri: str, data: bytes) -> None:
        (folder / uri).write_bytes(data)
        report_progress("export", 1)

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
    held = relative_texel_count(source.maps is not None, time)
    told = {
        "draw_calls": tiled.draw_calls,
        "bytes": tiled.bytes,
        "texture_mb": round(tiled.page_texels * held * encoded.bytes_per_texel * MIPMAP_FACTOR / 1e6, 1),
        "texels_used": round(tiled.used_texels / max(tiled.page_texels, 1), 4),
        "scale": round(scale, 4),
    }
    (folder / FIGURES).write_text(json.dumps(told, indent=1) + "\n")
    return ["tileset.json"], notes
