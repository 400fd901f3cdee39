"""Textured models of a published block: GLB and 3D Tiles."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from catalogs.features import safe_file_stem
from facade_core.core.arrays import IntArray
from facade_core.core.errors import InputError
from facade_core.export.lighting.relighting import build_relightable_mesh
from facade_core.export.models.encoders import ENCODERS, MIPMAP_FACTOR, texture_encoder
from facade_core.export.models.glb import encode_glb
from facade_core.export.models.gltf_materials import TimeOfDay, encode_textures, material_texel_ratio
from facade_core.export.models.textured_mesh import (
    PackedCharts,
    TexturedMesh,
    build_nodes,
    draw_page_images,
    encode_page,
    filter_triangles,
    mesh_y_up_frame,
    pack_charts_on_pages,
)
from facade_core.export.tiles.cells import build_quadtree
from facade_core.export.tiles.far_shells import build_shells
from facade_core.export.tiles.settings import TILE_CELLS
from facade_core.export.tiles.tileset import TiledModel, TileSettings, count_tiles, view_texture_scale, write_tileset
from tasks.engine.progress import begin_stage, report_progress
from tasks.export.earth import georeference_tiles
from tasks.export.factored import write_factored_glb, write_factored_tiles
from tasks.export.features import build_feature_table
from tasks.export.lighting import is_mostly_photographed, relighting_inputs
from tasks.export.registry import FACTORED
from tasks.export.relief import add_requested_relief, is_relief_requested
from tasks.export.surroundings import build_surrounding_model
from tasks.publish.published_run import PublishedBlock

# Default picture encoding of 3D Tiles, which every client reads.
DEFAULT_ENCODING = "jpeg"
# Statistics of a whole tileset, in its folder.
STATISTICS_FILE = "figures.json"
TEXTURE_FOLDER = "textures"


def mesh_with_requested_lighting(
    results: PublishedBlock, lit: bool | None, night: bool, relief: str | None, *, lit_by_default: bool
) -> tuple[TexturedMesh, list[str]]:
    """Return the mesh of a block, relit if requested, and notes.

    Parameters
    ----------
    results : published results of a block.
    lit : True: relight; False: keep colours; None: decide by `lit_by_default` and the share of photographs.
    night : night emission is requested.
    relief : elements as geometry, which maps then leave to it; see `is_relief_requested`.
    lit_by_default : the format is lit by default.

    Raises
    ------
    InputError : a night model of unlit materials.
    """
    asked = lit
    if lit is None:
        lit = (lit_by_default or night) and (night or not is_mostly_photographed(results))
    if not lit:
        if night:
            raise InputError("--night: is of what is lit; leave --no-lit out")
        whose = "its textures are the source's own photographs: models show them unlit; --lit has them lit all the same"
        return results.textured_mesh, [whose] if asked is None and lit_by_default else []
    inputs = relighting_inputs(results, has_relief=is_relief_requested(results, relief))
    return build_relightable_mesh(results.textured_mesh, inputs), []


def append_ground_index(results: PublishedBlock, buildings: IntArray) -> IntArray:
    """Append the index of the ground (-1) if the buildings are all of the block's."""
    return np.append(buildings, -1) if len(buildings) == len(results.select_buildings(())) else buildings


def write_texture_pages(
    source: TexturedMesh, shown: IntArray, folder: Path, other_units: int
) -> tuple[PackedCharts, list[str]]:
    """Write the texture pages of some buildings as JPEG files; return the packed charts, and the files by page.

    Parameters
    ----------
    source : mesh of the block.
    shown : (n,) indices of buildings, -1 for the ground.
    folder : target folder.
    other_units : units of progress after this step.
    """
    drawn = pack_charts_on_pages(source, source.select_charts(shown))
    images = [f"{TEXTURE_FOLDER}/{page:04}.jpg" for page in range(len(drawn.layout.pages))]
    begin_stage("export", len(images) + other_units)
    (folder / TEXTURE_FOLDER).mkdir()
    for page, image in enumerate(images):
        (folder / image).write_bytes(encode_page(drawn, page))
        report_progress("export", 1)
    return drawn, images


def write_glb_models(
    results: PublishedBlock,
    buildings: IntArray,
    folder: Path,
    *,
    textures: str | None = None,
    lit: bool | None = None,
    night: bool = False,
    relief: str | None = None,
) -> tuple[list[str], list[str]]:
    """Write block.glb with a node for each building, and buildings/ID.glb, in the block's local frame.

    Parameters
    ----------
    results : published results of a block.
    buildings : (n,) indices of buildings.
    folder : target folder.
    textures : FACTORED writes block.glb alone, factored; None: unique texels.
    lit : relight materials; see `mesh_with_requested_lighting`.
    night : start with night emission.
    relief : elements as geometry; see `add_requested_relief`.

    Returns
    -------
    files : files to open first.
    notes : remarks for the user.
    """
    if textures is not None:
        return write_factored_glb(results, buildings, append_ground_index(results, buildings), folder)

    source, notes = mesh_with_requested_lighting(results, lit, night, relief, lit_by_default=True)
    source = add_requested_relief(results, source, buildings, relief)
    frame = mesh_y_up_frame(results.plan.scene.mesh)
    extras = {"origin": frame.origin.tolist(), "crs": results.crs}
    (folder / "buildings").mkdir()
    begin_stage("export", len(buildings) + 1)

    def write(path: Path, selection: IntArray) -> None:
        drawn = pack_charts_on_pages(source, source.select_charts(selection))
        nodes, _ = build_nodes([drawn], results.names, frame)
        pages = range(len(drawn.layout.pages))
        textures_by_page = [encode_textures(draw_page_images(drawn, page), ENCODERS["jpeg"]) for page in pages]
        time: TimeOfDay = "night or day" if night else "day or night"
        named = results.attribution.line
        is_unlit = source.maps is None
        around = build_surrounding_model(results, selection, frame, is_unlit=is_unlit)
        path.write_bytes(
            encode_glb(nodes, textures_by_page, extras=extras, copyright=named, time=time, append=around.append)
        )
        report_progress("export", 1)

    for building in buildings.tolist():
        write(folder / "buildings" / f"{safe_file_stem(results.names[building])}.glb", np.array([building]))
    write(folder / "block.glb", append_ground_index(results, buildings))
    return ["block.glb"], notes


def write_3dtiles(
    results: PublishedBlock,
    buildings: IntArray,
    folder: Path,
    *,
    textures: str = DEFAULT_ENCODING,
    max_texture_mb: float | None = None,
    lit: bool | None = None,
    night: bool = False,
    crs: str | None = None,
    relief: str | None = None,
) -> tuple[list[str], list[str]]:
    """Write tileset.json and its georeferenced tiles, with the catalogue's columns as metadata.

    Parameters
    ----------
    results : published results of a block.
    buildings : (n,) indices of buildings.
    folder : target folder.
    textures : encoding of the pictures, or FACTORED.
    max_texture_mb : graphics memory of a view, MB; None: default of the encoding.
    lit : relight materials; see `mesh_with_requested_lighting`.
    night : bake night emission.
    crs : NATIVE_CRS: the block's own; None: earth-centred; see `georeference_tiles`.
    relief : elements as geometry in the finest tiles; see `add_requested_relief`.

    Returns
    -------
    files : files to open first.
    notes : remarks for the user.
    """
    if textures == FACTORED:
        return write_factored_tiles(results, buildings, append_ground_index(results, buildings), folder, crs)
    encoded = texture_encoder(textures)
    source, notes = mesh_with_requested_lighting(results, lit, night, relief, lit_by_default=False)
    shown = append_ground_index(results, buildings)
    chosen = np.isin(source.charts.building[source.mesh.chart], shown)
    source = replace(source, mesh=filter_triangles(source.mesh, chosen))
    density = results.plan.scene.spec.texels_per_metre
    frame, extras, earth_notes = georeference_tiles(results, mesh_y_up_frame(source.mesh).origin, crs)
    notes += earth_notes
    cells = build_quadtree(source)
    time: TimeOfDay = "night" if night else "day"
    around = build_surrounding_model(results, shown, frame, is_unlit=source.maps is None, is_instanced=True)
    begin_stage("export", len(buildings) + count_tiles(cells) + around.parts)
    shells = build_shells(source, density * TILE_CELLS.coarse_scale, lambda: report_progress("export", 1))
    view_mb = encoded.max_view_mb if max_texture_mb is None else max_texture_mb
    scale = view_texture_scale(source, shells, cells, encoded, view_mb * 1e6, time)
    if scale < 1:
        notes.append(
            f"textures have {scale:.2f} of the texels per metre, so that a view of them takes {view_mb:g} MB of a graphics "
            "card at most; --max-texture-mb inf keeps all"
        )
    for name in ("tiles", "tilesets"):
        (folder / name).mkdir()

    def write(uri: str, data: bytes) -> None:
        (folder / uri).write_bytes(data)
        report_progress("export", 1)

    tiled = write_tileset(
        TiledModel(
            source,
            shells,
            frame,
            build_feature_table(results),
            add_requested_relief(results, source, buildings, relief),
            around,
        ),
        cells,
        TileSettings(encoded, scale, time),
        write,
        extras=extras,
        attribution=results.attribution,
    )
    for name, value in tiled.tilesets.items():
        (folder / name).write_text(json.dumps(value, indent=1, allow_nan=False) + "\n")
    texel_factor = material_texel_ratio(source.maps is not None, time)
    statistics = {
        "draw_calls": tiled.draw_calls,
        "bytes": tiled.bytes,
        "texture_mb": round(tiled.page_texels * texel_factor * encoded.bytes_per_texel * MIPMAP_FACTOR / 1e6, 1),
        "texels_used": round(tiled.used_texels / max(tiled.page_texels, 1), 4),
        "scale": round(scale, 4),
    }
    (folder / STATISTICS_FILE).write_text(json.dumps(statistics, indent=1) + "\n")
    return ["tileset.json"], notes
