"""Charts of a scene textured from panoramas: as a run does it, and by plain projection from the best view of each texel."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np

from benchmarks.mesh_texturing.cases import UNSEEN_GREY, Case
from facade_core.core.provenance import Provenance
from facade_core.facade.photo_facade import MappedDoors, build_facade_from_photo
from facade_core.geometry.charts import ChartKind
from facade_core.imagery.cameras.camera_view import PanoramaCamera
from facade_core.imagery.cameras.exposure import (
    CommonExposure,
    estimate_common_exposure,
    sample_ground_colours,
    typical_ground_colour,
)
from facade_core.imagery.cameras.ground import fuse_ground_view
from facade_core.imagery.cameras.occluder_masks import (
    mask_building_occluders,
    mask_ground_occluders,
    mask_model_edges,
)
from facade_core.imagery.cameras.walls import fuse_wall_view
from facade_core.imagery.panorama_camera import GROUND_REACH_M
from facade_core.imagery.rectify.coverage import order_by_coverage
from facade_core.imagery.rectify.panorama import find_sightings, rectify_chart_from_panorama
from facade_core.plan.plan import Plan
from facade_core.street.materials.field import MaterialField
from facade_core.street.surfaces import KnownTexture, finish_chart
from tasks.stages.facades.evidence import read_evidence
from tasks.stages.facades.imagery import FacadeImagery
from tasks.stages.shared.captures import MAX_PANORAMAS
from tasks.stages.shared.panorama_index import UsablePanoramaIndex
from tasks.stages.shared.surface_panorama import SurfacePanorama

# A chart's raster and the provenance of its texels.
Texels = tuple[np.ndarray, np.ndarray]


def texture_as_a_run(case: Case, files: Sequence[Path]) -> dict[int, np.ndarray]:
    """Return the raster of each chart: facades parsed and completed, other walls and ground fused, materials elsewhere."""
    scene, poses, images = case.scene, case.poses, case.images
    squares = [sample_ground_colours(scene, image, pose).squares for image, pose in zip(images, poses, strict=True)]
    exposure = estimate_common_exposure(squares)
    known: dict[int, Texels] = {}
    for chart in case.facades:
        found = _texture_facade(case, chart, files, exposure)
        if found is not None:
            known[chart] = found
    taken, cameras = _select_panoramas(case, known.keys(), files, squares, exposure), _Cameras(case, files)
    walls = []
    for chart, nearest in taken.items():
        if scene.charts.kind[chart] == ChartKind.GROUND:
            view = fuse_ground_view(scene, chart, [cameras.before_ground(one) for one in nearest])
        else:
            view = fuse_wall_view(scene, chart, [cameras.before_walls(one) for one in nearest])
        if view is not None:
            rank = np.where(view.is_visible, Provenance.PHOTO, Provenance.UNSEEN).astype(np.uint8)
            known[chart] = (view.rgb, rank)
            walls.append(chart)
    materials = MaterialField(scene, case.streets, seed=1)
    texture = KnownTexture(_Reader(case, known), known, walls)
    return {chart: finish_chart(scene, materials, chart, texture)[0] for chart in range(len(scene.charts))}


def _select_panoramas(
    case: Case,
    done: Container[int],
    files: Sequence[Path],
    squares: Sequence[Sequence[Sequence[int]]],
    exposure: CommonExposure,
) -> dict[int, Sequence[SurfacePanorama]]:
    """Select the panoramas of each ground, wall and roof that is not done, as a run does."""
    every = tuple(
        SurfacePanorama(file, pose, tuple(factor), tuple(tuple(square) for square in own))
        for file, pose, factor, own in zip(files, case.poses, exposure.factors.tolist(), squares, strict=True)
    )
    index, charts = UsablePanoramaIndex(every), case.scene.charts
    taken: dict[int, Sequence[SurfacePanorama]] = {}
    walls: dict[int, list[int]] = {}
    for chart in range(len(charts)):
        if chart in done:
            continue
        if charts.kind[chart] == ChartKind.GROUND:
            taken[chart] = index.near(charts, [chart], GROUND_REACH_M)
        elif chart in case.other_walls:
            walls.setdefault(int(charts.building[chart]), []).append(chart)
    for some in walls.values():
        taken |= dict(zip(some, index.select_by_chart(charts, some), strict=True))
    return taken


class _Cameras:
    """Cameras of a case, opened when a surface first asks for them."""

    def __init__(self, case: Case, files: Sequence[Path]) -> None:
        self.case, self.images = case, dict(zip(files, case.images, strict=True))
        self.before_ground, self.before_walls = cache(self._before_ground), cache(self._before_walls)

    def _before_ground(self, one: SurfacePanorama) -> PanoramaCamera:
        return self._open(one, mask_ground_occluders(self.images[one.path], one.pose))

    def _before_walls(self, one: SurfacePanorama) -> PanoramaCamera:
        image = self.images[one.path]
        edges = mask_model_edges(self.case.scene, one.pose, image.shape[:2])
        return self._open(one, mask_building_occluders(image, one.pose) | edges)

    def _open(self, one: SurfacePanorama, occluded: np.ndarray) -> PanoramaCamera:
        colour = typical_ground_colour(one.squares)
        return PanoramaCamera(self.images[one.path], one.pose, occluded, np.array(one.factor), colour)


class _Reader:
    """Reader of what is known of charts, as a run reads its base layer."""

    def __init__(self, case: Case, known: Mapping[int, Texels]) -> None:
        self.case, self.known = case, known

    def __call__(self, chart: int, rows: slice, columns: slice) -> Texels:
        if chart not in self.known:
            shape = (rows.stop - rows.start, columns.stop - columns.start)
            return np.zeros((*shape, 3), np.uint8), np.zeros(shape, np.uint8)
        rgb, rank = self.known[chart]
        return rgb[rows, columns], rank[rows, columns]


def _texture_facade(case: Case, chart: int, files: Sequence[Path], exposure: CommonExposure) -> Texels | None:
    size = case.size(chart)
    sizes = [image.shape[:2] for image in case.images]
    shown = order_by_coverage(find_sightings(case.scene, chart, case.poses, sizes))[:MAX_PANORAMAS]
    if not shown:
        return None
    numbers = [one.panorama for one in shown]
    imagery = FacadeImagery(
        panoramas=tuple((files[number], case.poses[number]) for number in numbers),
        exposure_factors={
            files[number]: tuple(exposure.factors[number].tolist()) for number in numbers if exposure.is_shared[number]
        },
    )
    # of a plan the scene alone is looked at
    plan = cast(Plan, SimpleNamespace(scene=case.scene))
    evidence = read_evidence("panoramas", plan, chart, size, imagery, {}, [])
    if evidence is None:
        return None
    made = build_facade_from_photo(evidence, doors=MappedDoors((), front=True), seed=1)
    return made.image, made.provenance


def texture_by_best_view(case: Case) -> dict[int, np.ndarray]:
    """Return the raster of each chart: each texel from the panorama that shows it best, UNSEEN_GREY where none does."""
    return {chart: _best_view(case, chart) for chart in range(len(case.scene.charts))}


def _best_view(case: Case, chart: int) -> np.ndarray:
    size = case.size(chart)
    rgb, best = np.full((*size, 3), UNSEEN_GREY, np.uint8), np.zeros(size, np.float32)
    for image, pose in zip(case.images, case.poses, strict=True):
        view = rectify_chart_from_panorama(case.scene, chart, image, pose, size)
        better = view.seen & (view.quality > best)
        rgb[better], best[better] = view.rgb[better], view.quality[better]
    return rgb
