"""Facades of a published block as factored walls, instances of elements from shared libraries."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from catalogs.block.reader import read_block
from facade_core.atlas.rasters import read_chart_raster
from facade_core.core.arrays import Int64Array, IntArray, UInt8Array
from facade_core.core.errors import FacadeError, InputError
from facade_core.core.grouping import group_rows
from facade_core.core.resizing import resize_image
from facade_core.export.bodies.openings import chart_outlines
from facade_core.export.factored.library import FacadeLibrary, build_library
from facade_core.export.factored.wall_decomposition import StoredFacadeWall, WallDecomposition
from facade_core.export.factored.wall_geometry import (
    WallDetailLevel,
    WallPieces,
    WallPolygon,
    build_wall,
    is_planar_and_valid,
)
from facade_core.parsing.elements import elements
from tasks.engine.progress import begin_stage, report_progress
from tasks.engine.store.status import read_run_block_file
from tasks.harvest.block_style import list_harvested_exemplars
from tasks.publish.published_run import PublishedBlock
from tasks.stages.shared.images import read_exemplar_picture

# Maximum mean difference between an original and its stored picture in any square, grey levels, and the square's side: half
# of a face at the texels of a block, so that a part that was replaced is noticed.
MAX_GREY_DIFFERENCE = 4.0
_COMPARED_SIDE_PX = 5


@dataclass(frozen=True, eq=False)
class FactoredWalls:
    """Factored walls of some buildings.

    Attributes
    ----------
    charts : (n,) charts of the factored facades.
    libraries : facade libraries.
    details : wall pieces by building, for each detail.
    notes : remarks for the user.
    """

    charts: Int64Array
    libraries: list[FacadeLibrary]
    details: list[dict[int, WallPieces]]
    notes: list[str]


def build_factored_walls(
    results: PublishedBlock, buildings: IntArray, details: Sequence[WallDetailLevel], other_units: int
) -> FactoredWalls:
    """Build the facades of some buildings from libraries, at each of some details.

    Parameters
    ----------
    results : published results of a block.
    buildings : (n,) indices of buildings.
    details : details to build.
    other_units : units of progress after this step.
    """
    source = results.textured_mesh
    planes = _planar_walls(results, buildings)
    libraries, library_index, notes = _build_libraries(results, list(planes))
    begin_stage("export", len(planes) + other_units)
    of_building = group_rows(source.charts.building[source.mesh.chart])
    by_detail: list[dict[int, WallPieces]] = [{} for _ in details]
    for index, polygons in planes.items():
        building = int(results.plan.facades.building[index])
        behind = [source.mesh.vertices[source.mesh.triangles[of_building[building]]]]
        decomposition = WallDecomposition(_read_facade(results, index), libraries[library_index[index]])
        for detail, pieces in zip(details, by_detail, strict=True):
            build_wall(
                decomposition,
                polygons,
                source.charts,
                library_index[index],
                detail,
                list(behind),
                pieces.setdefault(building, WallPieces()),
            )
        report_progress("export", 1)
    charts = np.array(sorted(int(results.plan.facades.chart[index]) for index in planes), np.int64)
    return FactoredWalls(charts, libraries, by_detail, notes)


def _planar_walls(results: PublishedBlock, buildings: IntArray) -> dict[int, list[WallPolygon]]:
    """Collect the polygons of facades with a finished layout and planar walls."""
    source = results.textured_mesh
    of_chart = group_rows(source.mesh.chart)
    planes = {}
    for index in results.select_finished_facades(buildings):
        chart = int(results.plan.facades.chart[index])
        triangles = source.mesh.triangles[of_chart.get(chart, np.zeros(0, np.int64))]
        corners = source.mesh.vertices[triangles]
        polygons = [
            WallPolygon(outline, corners.reshape(-1, 3)) for outline in chart_outlines(source.coordinates[triangles])
        ]
        if polygons and all(map(is_planar_and_valid, polygons)):
            planes[index] = polygons
    return planes


def _build_libraries(
    results: PublishedBlock, facades: Sequence[int]
) -> tuple[list[FacadeLibrary], dict[int, int], list[str]]:
    """Build a library for each exemplar in use and for each photographed facade; map facades to them."""
    exemplars = {r["unit"]: (k, r) for k, r in enumerate(results.journals["exemplars"]) if r and r["status"] == "done"}
    given = _original_exemplars(results)
    libraries: list[FacadeLibrary] = []
    number: dict[str, int] = {}
    library_index: dict[int, int] = {}
    coarse = 0
    placement = results.plan.scene.placement
    begin_stage("libraries", len({_facade_source(results, index) for index in facades}))
    for index in facades:
        source = _facade_source(results, index)
        if source not in number:
            if source in exemplars:
                k, record = exemplars[source]
                image, labels = (results.group[f"{record['folder']}/{name}"][:] for name in ("image", "labels"))
                fine = _read_original(given.get(source), image)
                coarse += fine is None
                density = 1 / float(record["metres_per_texel"])
                library = build_library(image, labels, elements(labels), density, fine, seed=k)
            else:
                chart = int(results.plan.facades.chart[index])
                image, labels = (
                    read_chart_raster(results.group, placement, chart, name)
                    for name in ("atlas/seed", "facade_maps/labels")
                )
                density = float(placement.texels_per_metre[chart])
                library = build_library(image, labels, results.elements(index), density, seed=chart)
            number[source] = len(libraries)
            libraries.append(library)
            report_progress("libraries", 1)
        library_index[index] = number[source]
    notes = []
    if coarse:
        notes = [
            f"{coarse} exemplars are not where the block file says, or show something that was made anew: their elements "
            "have no more texels than the store"
        ]
    return libraries, library_index, notes


def _facade_source(results: PublishedBlock, index: int) -> str:
    record = results.records[index]
    assert record is not None  # it has a layout
    return str(record["source"])


def _original_exemplars(results: PublishedBlock) -> dict[str, Path]:
    """Find the original exemplar files that still exist, by name."""
    path = read_run_block_file(results.snapshot.out)
    if path is None:
        return {}
    try:
        given = read_block(path).exemplars
    except InputError:
        return {}
    return {exemplar.stem: exemplar for exemplar in (*list_harvested_exemplars(results.snapshot.out), *given)}


def _read_original(path: Path | None, image: UInt8Array) -> UInt8Array | None:
    """Read an exemplar at full resolution; None if it differs from the stored picture or is not larger.

    A stored picture differs if occluders or private areas were replaced in it.
    """
    if path is None:
        return None
    try:
        fine = read_exemplar_picture(path).rgb
    except (FacadeError, OSError):
        return None
    return fine if fine.shape[0] > image.shape[0] and is_shown_whole(fine, image) else None


def is_shown_whole(original: UInt8Array, stored: UInt8Array) -> bool:
    """Return whether a stored picture shows its original everywhere, without a replaced occluder or private area."""
    import cv2

    difference = np.abs(resize_image(original, stored.shape[:2]).astype(np.float32) - stored).mean(axis=2)
    return float(cv2.blur(difference, (_COMPARED_SIDE_PX, _COMPARED_SIDE_PX)).max()) <= MAX_GREY_DIFFERENCE


def _read_facade(results: PublishedBlock, index: int) -> StoredFacadeWall:

    placement, chart = results.plan.scene.placement, int(results.plan.facades.chart[index])
    seed, labels = (
        read_chart_raster(results.group, placement, chart, name) for name in ("atlas/seed", "facade_maps/labels")
    )
    density = float(placement.texels_per_metre[chart])
    return StoredFacadeWall(chart, seed, results.textured_mesh.raster(chart), labels, results.elements(index), density)
