"""Ground charts from posed panoramas: each texel from the best camera, where cameras agree.

Objects that the model lacks (cars, people, kerbs, the camera's own vehicle) appear at different ground positions in
each camera, by parallax. Squares in which cameras contradict each other are left to the material. Ground whose detail two
cameras show alike is bare, whatever the occluder parser says.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array
from facade_core.core.types import Pose
from facade_core.geometry.scene import Scene
from facade_core.imagery.cameras.agreement import (
    compare_views_by_squares,
    find_ground_lines,
    find_thin_objects,
    grow_mask,
    squares_to_texels,
)
from facade_core.imagery.cameras.camera_view import (
    FusedCameraView,
    PanoramaCamera,
    equalise_exposure,
    fuse_camera_views,
)
from facade_core.imagery.cameras.matching_detail import find_matching_detail, select_parallax_pairs
from facade_core.imagery.cameras.settings import GROUND
from facade_core.imagery.panorama_camera import GROUND_REACH_M, camera_position, camera_reach
from facade_core.imagery.rectify.fusion import ChartView
from facade_core.imagery.rectify.panorama import rectify_chart_from_panorama


class _GroundView(NamedTuple):
    """Ground chart as one camera shows it.

    Attributes
    ----------
    view : the chart in the common exposure, within the camera's reach.
    private : (h, w) bool, faces and number plates; None without any.
    pose : pose of the camera.
    ground_colour : typical ground colour in the common exposure.
    """

    view: ChartView
    private: BoolArray | None
    pose: Pose
    ground_colour: tuple[Float64Array, Float64Array] | None


def fuse_ground_view(scene: Scene, chart: int, cameras: Iterable[PanoramaCamera]) -> FusedCameraView | None:
    """Fuse a ground chart from panoramas.

    A square that several cameras show comes from cameras that agree with another camera. A square that only one camera shows
    is used if it has the typical ground colour, and if other cameras do not contradict that camera elsewhere.

    Parameters
    ----------
    scene : scene that contains the chart.
    chart : index of the ground chart.
    cameras : panoramas around it; of each, nothing but its view of the chart is kept.

    Returns
    -------
    The fused view, None where the cameras show too little.
    """
    density = float(scene.placement.texels_per_metre[chart])
    shown = [_ground_view(scene, chart, camera) for camera in cameras]
    views = _clear_matching_ground(scene, chart, shown)
    if not any(bool(view.clear.any()) for view in views):
        return None
    lines = find_ground_lines(views, [_foot(scene, chart, one.pose) for one in shown], density)
    plain = [replace(view, occluded=view.seen & ~(view.clear & ~line)) for view, line in zip(views, lines, strict=True)]
    trusted = select_trusted_ground_texels(plain, [one.ground_colour for one in shown], density)
    rim = round(GROUND.doubt_rim_m * density)
    return fuse_camera_views(
        views, [mask | line & grow_mask(mask, rim) for mask, line in zip(trusted, lines, strict=True)], density
    )


def _foot(scene: Scene, chart: int, pose: Pose) -> Float64Array:
    """Return column and row (2,) of the texel below a camera."""
    charts, density = scene.charts, float(scene.placement.texels_per_metre[chart])
    offset = camera_position(pose) - charts.origin[chart]
    return np.array([offset @ charts.axis_u[chart], offset @ charts.axis_v[chart]]) * density


def select_trusted_ground_texels(
    views: Sequence[ChartView],
    ground_colours: Sequence[tuple[Float64Array, Float64Array] | None],
    density: float,
) -> list[BoolArray]:
    """Select the clear texels of each view that can be trusted.

    Parameters
    ----------
    views : views of one chart, of equal size and exposure.
    ground_colours : see `typical_ground_colour`, in the views' exposure.
    density : texels per metre.

    Returns
    -------
    One mask (h, w) bool per view.
    """
    squares, trusted, rim = compare_views_by_squares(views, density), [], round(GROUND.doubt_rim_m * density)
    for i, view in enumerate(views):
        supported, opposed, alone = (
            squares.is_confirmed[i],
            squares.is_contradicted[i],
            squares.find_unconfirmed_squares(i),
        )
        ground_colour = ground_colours[i]
        confirmed_count = int(supported.sum())
        if ground_colour is None or confirmed_count < GROUND.min_confirmed_share * (supported | opposed).sum():
            alone[:] = False
        else:
            middle, spread = ground_colour
            alone &= (
                np.abs(squares.log_colour[i] - middle)
                <= np.maximum(GROUND.max_log_deviation, GROUND.max_deviation_spreads * spread)
            ).all(axis=2)
        doubted = squares.is_usable[i] & ~supported & ~alone
        texels = [squares_to_texels(square, squares.side, view.seen.shape) for square in (supported, alone, doubted)]
        trusted.append(view.clear & (texels[0] | texels[1]) & ~grow_mask(texels[2], rim))
    return [
        is_trusted & ~is_thin for is_trusted, is_thin in zip(trusted, find_thin_objects(views, density), strict=True)
    ]


def _clear_matching_ground(scene: Scene, chart: int, shown: Sequence[_GroundView]) -> list[ChartView]:
    """Return the views with the ground that two cameras show in the same detail no longer occluded, unless it is private."""
    views = [one.view for one in shown]
    height = float(scene.charts.points_at_shares(np.array([chart]), np.array([[0.5, 0.5]]))[0, 0, 2])
    pairs = select_parallax_pairs([one.pose for one in shown], height)
    if not pairs:
        return views
    density = float(scene.placement.texels_per_metre[chart])
    cleared = []
    for view, one, is_bare in zip(views, shown, find_matching_detail(views, density, pairs), strict=True):
        occluded = view.seen & ~view.clear & ~is_bare
        if one.private is not None:
            occluded |= view.seen & one.private
        cleared.append(replace(view, occluded=occluded))
    return cleared


def _ground_view(scene: Scene, chart: int, camera: PanoramaCamera) -> _GroundView:
    """Rectify a chart in the common exposure, within the camera's reach; nearer than min_ground_distance_m it is occluded."""
    size = scene.placement.shape(chart)
    distance = _ground_distance(scene, chart, camera.pose)
    view = rectify_chart_from_panorama(scene, chart, camera.image, camera.pose, size, camera.occluded)
    reach = camera_reach(camera.pose, GROUND_REACH_M)
    hidden = view.seen & (~view.clear | (distance < GROUND.min_ground_distance_m))
    view = equalise_exposure(replace(view, occluded=hidden), camera, distance <= reach)
    private = None
    if camera.private is not None:
        faced = rectify_chart_from_panorama(scene, chart, camera.image, camera.pose, size, camera.private)
        private = faced.seen & ~faced.clear
    return _GroundView(view, private, camera.pose, _equalised_ground_colour(camera))


def _ground_distance(scene: Scene, chart: int, pose: Pose) -> Float32Array:
    """Horizontal distance in metres of each texel from a camera, of an aerial one the whole distance: (h, w) float32."""
    charts, step = scene.charts, 1 / float(scene.placement.texels_per_metre[chart])
    centre = camera_position(pose)
    x = (np.arange(int(scene.placement.width[chart]), dtype=np.float32) + 0.5) * step
    y = (np.arange(int(scene.placement.height[chart]), dtype=np.float32) + 0.5) * step
    corner = (charts.origin[chart] - centre)[:2]
    across, down = charts.axis_u[chart][:2], charts.axis_v[chart][:2]
    east = corner[0] + across[0] * x[None] + down[0] * y[:, None]
    north = corner[1] + across[1] * x[None] + down[1] * y[:, None]
    level = np.hypot(east, north)
    if pose.is_aerial:
        up = charts.origin[chart][2] - centre[2]
        level = np.hypot(level, up + charts.axis_u[chart][2] * x[None] + charts.axis_v[chart][2] * y[:, None])
    distance: Float32Array = level.astype(np.float32)
    return distance


def _equalised_ground_colour(camera: PanoramaCamera) -> tuple[Float64Array, Float64Array] | None:
    """Typical ground colour in the common exposure."""
    return (
        None
        if camera.ground_colour is None
        else (camera.ground_colour[0] + np.log(camera.exposure_factor), camera.ground_colour[1])
    )
