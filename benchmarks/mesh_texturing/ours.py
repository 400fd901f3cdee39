"""Charts of a scene textured from panoramas: as a run does it, and by plain projection from the best view of each texel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np

from benchmarks.mesh_texturing.cases import UNSEEN_GREY, Case
from facade_core.core.provenance import Provenance
from facade_core.facade.photo_facade import MappedDoors, PhotoMasks, build_facade_from_photo
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
from facade_core.imagery.panorama_camera import GROUND_REACH_M, WALL_REACH_M, camera_position, is_any_in_view
from facade_core.imagery.rectify.coverage import order_by_coverage
from facade_core.imagery.rectify.panorama import find_sightings, rectify_chart_from_panorama
from facade_core.plan.plan import Plan
from facade_core.street.materials.field import MaterialField
from facade_core.street.surfaces import KnownTexture, finish_chart
from tasks.stages.bundles.nearby_panoramas import MAX_PANORAMAS_PER_SURFACE, VIEW_SHARES
from tasks.stages.facades.captures import MAX_PANORAMAS
from tasks.stages.facades.evidence import read_evidence
from tasks.stages.facades.imagery import FacadeImagery

# A chart's raster and the provenance of its texels.
Texels = tuple[np.ndarray, np.ndarray]


def texture_as_a_run(case: Case, files: Sequence[Path]) -> dict[int, np.ndarray]:
    """Return the raster of each chart: facades parsed and completed, other walls and ground fused, materials elsewhere."""
    scene, poses, images = case.scene, case.poses, case.images
    squares = [sample_ground_colours(scene, image, pose).squares for image, pose in zip(images, poses, strict=True)]
    exposure = estimate_common_exposure(squares)
    cameras = [
        PanoramaCamera(image, pose, np.zeros(image.shape[:2], bool), factor, typical_ground_colour(own))
        for image, pose, factor, own in zip(images, poses, exposure.factors, squares, strict=True)
    ]
    built = [
        _hide(camera, mask_building_occluders(camera.image, camera.pose) | mask_model_edges(scene, camera.pose, shape))
        for camera in cameras
        for shape in [camera.image.shape[:2]]
    ]
    ground = [_hide(camera, mask_ground_occluders(camera.image, camera.pose)) for camera in cameras]
    known: dict[int, Texels] = {}
    for chart in case.facades:
        found = _texture_facade(case, chart, files, exposure)
        if found is not None:
            known[chart] = found
    walls = []
    for chart in range(len(scene.charts)):
        if chart in known:
            continue
        if scene.charts.kind[chart] == ChartKind.GROUND:
            view = fuse_ground_view(scene, chart, _nearest_cameras(case, chart, ground, GROUND_REACH_M))
        elif chart in case.other_walls:
            view = fuse_wall_view(scene, chart, _nearest_cameras(case, chart, built, WALL_REACH_M))
        else:
            continue
        if view is not None:
            rank = np.where(view.is_visible, Provenance.PHOTO, Provenance.UNSEEN).astype(np.uint8)
            known[chart] = (view.rgb, rank)
            walls.append(chart)
    materials = MaterialField(scene, case.streets, seed=1)
    texture = KnownTexture(_Reader(case, known), known, (), walls)
    return {chart: finish_chart(scene, materials, chart, texture)[0] for chart in range(len(scene.charts))}


def _nearest_cameras(case: Case, chart: int, cameras: Sequence[PanoramaCamera], reach: float) -> list[PanoramaCamera]:
    """Return the nearest cameras that may show a chart, as many as a run takes."""
    points = case.scene.charts.points_at_shares(np.array([chart]), VIEW_SHARES)[0]
    middle = points.mean(axis=0)
    away = [float(np.linalg.norm(camera_position(camera.pose)[:2] - middle[:2])) for camera in cameras]
    near = [
        number
        for number in np.argsort(away, kind="stable").tolist()
        if is_any_in_view(cameras[number].pose, points)
        and np.linalg.norm(points[:, :2] - camera_position(cameras[number].pose)[:2], axis=1).min() <= reach
    ]
    return [cameras[number] for number in sorted(near[:MAX_PANORAMAS_PER_SURFACE])] or list(cameras[:1])


def _hide(camera: PanoramaCamera, occluded: np.ndarray) -> PanoramaCamera:
    return PanoramaCamera(camera.image, camera.pose, occluded, camera.exposure_factor, camera.ground_colour)


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
    evidence = read_evidence("panoramas", plan, chart, size, imagery, (), [])
    if evidence is None:
        return None
    made = build_facade_from_photo(
        evidence.image,
        evidence.hidden,
        masks=PhotoMasks(None, evidence.outside, evidence.seen.private_mask(size), evidence.clean),
        doors=MappedDoors((), front=True),
        seed=1,
    )
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
