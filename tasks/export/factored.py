"""Factored models of a published block: walls from `facade_core.export.factored`, other charts on pages."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from facade_core.core.arrays import IntArray
from facade_core.core.grouping import RowsByValue
from facade_core.export.factored.glb import encode_factored_glb
from facade_core.export.factored.parts import build_factored_primitives, merge_pieces, pack_unfactored_charts
from facade_core.export.factored.texture_packing import PackedTextures, pack_textures, texture_memory_bytes
from facade_core.export.factored.tiles import FactoredLeafBuilder
from facade_core.export.factored.wall_geometry import FAR_DETAIL, NEAR_DETAIL, WallPieces
from facade_core.export.models.encoders import MIPMAP_FACTOR, texture_encoder
from facade_core.export.models.textured_mesh import filter_triangles, mesh_y_up_frame
from facade_core.export.tiles.cells import build_quadtree
from facade_core.export.tiles.far_shells import build_shells
from facade_core.export.tiles.settings import TILE_CELLS
from facade_core.export.tiles.tileset import TiledModel, TileSettings, count_tiles, write_tileset
from tasks.engine.progress import report_progress
from tasks.export.earth import georeference_tiles
from tasks.export.factored_walls import build_factored_walls
from tasks.export.features import build_feature_table
from tasks.export.surroundings import build_surrounding_model
from tasks.publish.published_run import PublishedBlock

STATISTICS_FILE = "figures.json"
# Texels per metre of coarse tiles relative to those of tilesets with unique texels.
COARSE_TEXEL_SHARE = 0.5


def write_factored_glb(
    results: PublishedBlock, buildings: IntArray, shown: IntArray, folder: Path
) -> tuple[list[str], list[str]]:
    """Write block.glb with factored facades and a node for each building, and figures.json.

    Parameters
    ----------
    results : published results of a block.
    buildings : (n,) indices of buildings.
    shown : the buildings, and -1 for the ground.
    folder : target folder.

    Returns
    -------
    files : files to open first.
    notes : remarks for the user.
    """
    start = time.monotonic()
    source = results.textured_mesh
    walls = build_factored_walls(results, buildings, [NEAR_DETAIL], 1)
    pieces_of = walls.details[0]
    whole = merge_pieces(pieces_of.values())
    pictures = pack_textures(whole, walls.libraries)
    frame = mesh_y_up_frame(results.plan.scene.mesh)
    others = np.setdiff1d(source.select_charts(shown), walls.charts)
    pages, parts = pack_unfactored_charts(source, RowsByValue(source.mesh.chart), others, len(pictures.pictures), frame)
    for building, pieces in sorted(pieces_of.items()):
        parts[building] = build_factored_primitives(pieces, pictures, frame) | parts.get(building, {})
    used = texture_encoder("jpeg")
    encoded = [used.encode(picture) for picture in (*pictures.pictures, *pages)]
    names = {-1: "ground", **results.names}
    order = sorted(parts, key=lambda building: (building < 0, building))
    data = encode_factored_glb(
        {names[building]: parts[building] for building in order},
        encoded,
        [*pictures.is_repeated, *[False] * len(pages)],
        used,
        build_feature_table(results),
        extras={"origin": frame.origin.tolist(), "crs": results.crs},
        copyright=results.attribution.line,
    )
    (folder / "block.glb").write_bytes(data)
    statistics = _texture_statistics(pictures, whole, texture_memory_bytes(pages)) | {
        "bytes": len(data),
        "picture_bytes": sum(map(len, encoded)),
        "triangles": sum(len(part.triangles) for own in parts.values() for part in own.values()),
        "draw_calls": sum(map(len, parts.values())),
        "buildings": len(buildings),
        "facades": len(walls.charts),
        "seconds": round(time.monotonic() - start, 1),
    }
    (folder / STATISTICS_FILE).write_text(json.dumps(statistics, indent=1) + "\n")
    report_progress("export", 1)
    return ["block.glb"], walls.notes


def write_factored_tiles(
    results: PublishedBlock, buildings: IntArray, shown: IntArray, folder: Path, crs: str | None = None
) -> tuple[list[str], list[str]]:
    """Write tileset.json and tiles with factored leaves, which share picture files.

    A leaf has a near detail, and a far detail with the fewest element types.

    Parameters
    ----------
    results : published results of a block.
    buildings : (n,) indices of buildings.
    shown : the buildings, and -1 for the ground.
    folder : target folder.
    crs : of the tiles; see `write_3dtiles`.

    Returns
    -------
    files : files to open first.
    notes : remarks for the user.
    """
    start = time.monotonic()
    whole = results.textured_mesh
    source = replace(whole, mesh=filter_triangles(whole.mesh, np.isin(whole.charts.building[whole.mesh.chart], shown)))
    frame, extras, notes = georeference_tiles(results, mesh_y_up_frame(source.mesh).origin, crs)
    cells = build_quadtree(source)
    around = build_surrounding_model(results, shown, frame, is_instanced=True)
    count = len(buildings) + count_tiles(cells, 2) + around.parts
    walls = build_factored_walls(results, buildings, [FAR_DETAIL, NEAR_DETAIL], count)
    far, near = walls.details
    every = merge_pieces([*far.values(), *near.values()])
    pictures, used, features = (
        pack_textures(every, walls.libraries),
        texture_encoder("jpeg"),
        build_feature_table(results),
    )
    shells = build_shells(
        source,
        results.plan.scene.spec.texels_per_metre * TILE_CELLS.coarse_scale,
        lambda: report_progress("export", 1),
    )
    for name in ("tiles", "tilesets", "pictures"):
        (folder / name).mkdir()
    picture_bytes = 0

    def write_picture(uri: str, data: bytes) -> None:
        nonlocal picture_bytes
        picture_bytes += len(data)
        (folder / uri).write_bytes(data)

    def write(uri: str, data: bytes) -> None:
        (folder / uri).write_bytes(data)
        report_progress("export", 1)

    names = [f"pictures/{k}.jpg" for k in range(len(pictures.pictures))]
    for name, picture in zip(names, pictures.pictures, strict=True):
        write_picture(name, used.encode(picture))
    others = np.setdiff1d(source.select_charts(shown), walls.charts)
    leaves = FactoredLeafBuilder(
        {"far": far, "near": near},
        pictures,
        names,
        source,
        others,
        frame,
        features,
        used,
        results.attribution.line,
        write_picture,
    )
    tiled = write_tileset(
        TiledModel(source, shells, frame, features, around=around),
        cells,
        TileSettings(used, COARSE_TEXEL_SHARE, levels=leaves.build_detail_levels),
        write,
        extras=extras,
        attribution=results.attribution,
    )
    report_progress("export", sum(map(leaves.is_unfactored, cells.leaves())))
    for name, value in tiled.tilesets.items():
        (folder / name).write_text(json.dumps(value, indent=1, allow_nan=False) + "\n")
    coarse = tiled.page_texels * used.bytes_per_texel * MIPMAP_FACTOR
    statistics = _texture_statistics(pictures, merge_pieces(near.values()), leaves.texture_bytes) | {
        "texture_mb_of_coarse_tiles": round(coarse / 1e6, 1),
        "texture_mb": round((texture_memory_bytes(pictures.pictures) + leaves.texture_bytes + coarse) / 1e6, 1),
        "bytes": tiled.bytes + picture_bytes,
        "picture_bytes": picture_bytes,
        "types_from_far": len({key for key, _ in merge_pieces(far.values()).elements}),
        "triangles": leaves.triangles,
        "draw_calls": tiled.draw_calls,
        "buildings": len(buildings),
        "facades": len(walls.charts),
        "seconds": round(time.monotonic() - start, 1),
    }
    (folder / STATISTICS_FILE).write_text(json.dumps(statistics, indent=1) + "\n")
    return ["tileset.json"], [*notes, *walls.notes]


def _texture_statistics(pictures: PackedTextures, whole: WallPieces, rest_bytes: float) -> dict[str, object]:
    """Summarise graphics memory by kind of picture, and the texel density of elements."""
    grains = texture_memory_bytes(
        [one for one, again in zip(pictures.pictures, pictures.is_repeated, strict=True) if again]
    )
    density = np.array([density * pictures.scale[key] for key, density in whole.elements] or [0.0])
    return {
        "texture_mb": round((texture_memory_bytes(pictures.pictures) + rest_bytes) / 1e6, 1),
        "texture_mb_of_grains": round(grains / 1e6, 1),
        "texture_mb_of_elements": round((texture_memory_bytes(pictures.pictures) - grains) / 1e6, 1),
        "texture_mb_of_the_rest": round(rest_bytes / 1e6, 1),
        "elements": len(whole.elements),
        "types": len({key for key, _ in whole.elements}),
        "texels_per_metre_of_elements": {
            str(q): round(float(np.percentile(density, q)), 1) for q in (5, 25, 50, 75, 95)
        },
    }
