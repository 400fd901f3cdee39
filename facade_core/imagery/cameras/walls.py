"""Walls without a facade layout, and roofs, from posed panoramas: each texel from the best camera.

Occluders and the sky are masked by the parser first. Squares in which two cameras differ, by parallax, are left to the
material. Squares that one camera alone shows are used.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.core.arrays import BoolArray
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.overhead_view import texel_points
from facade_core.geometry.scene import Scene
from facade_core.imagery.cameras.agreement import compare_views_by_squares, squares_to_texels
from facade_core.imagery.cameras.camera_view import (
    FusedCameraView,
    PanoramaCamera,
    equalise_exposure,
    fuse_camera_views,
)
from facade_core.imagery.cameras.settings import WALLS
from facade_core.imagery.panorama_camera import WALL_REACH_M, camera_position, camera_reach
from facade_core.imagery.rectify.fusion import ChartView
from facade_core.imagery.rectify.panorama import rectify_chart_from_panorama

# Fractional bits of the outlines that OpenCV draws.
SUBTEXEL_BITS = 4


def fuse_wall_view(scene: Scene, chart: int, cameras: Sequence[PanoramaCamera]) -> FusedCameraView | None:
    """Fuse a wall or roof chart from panoramas; None where the cameras show too little."""
    coverage = chart_coverage_mask(scene, chart)
    views = [_wall_view(scene, chart, camera, coverage) for camera in cameras]
    if not any(bool(view.clear.any()) for view in views):
        return None
    density = float(scene.placement.texels_per_metre[chart])
    is_low = [_low_texels(scene, chart, camera) for camera in cameras]
    return fuse_camera_views(views, select_trusted_wall_texels(views, is_low, density), density)


def select_trusted_wall_texels(
    views: Sequence[ChartView], is_low: Sequence[BoolArray], density: float
) -> list[BoolArray]:
    """Select the clear texels of each view that can be trusted.

    Parameters
    ----------
    views : views of one chart, of equal size and exposure.
    is_low : (h, w) bool per view, texels that need a second camera.
    density : texels per metre.

    Returns
    -------
    One mask (h, w) bool per view.
    """
    squares, trusted = compare_views_by_squares(views, density), []
    for i, view in enumerate(views):
        is_confirmed, is_unconfirmed = (
            squares_to_texels(one, squares.side, view.seen.shape)
            for one in (squares.is_confirmed[i], squares.find_unconfirmed_squares(i))
        )
        trusted.append(view.clear & (is_confirmed | (is_unconfirmed & ~is_low[i])))
    return trusted


def _low_texels(scene: Scene, chart: int, camera: PanoramaCamera) -> BoolArray:
    """Texels (h, w) bool so far below a camera that objects on the ground may occlude them; no roof from above is."""
    if scene.charts.kind[chart] == ChartKind.ROOF and camera.pose.is_aerial:
        return np.zeros(scene.placement.shape(chart), bool)
    rows, columns = (np.arange(int(n)) + 0.5 for n in (scene.placement.height[chart], scene.placement.width[chart]))
    return np.asarray(
        texel_points(scene, chart, rows, columns)[..., 2]
        < camera_position(camera.pose)[2] - WALLS.max_unconfirmed_drop_m
    )


def _wall_view(scene: Scene, chart: int, camera: PanoramaCamera, coverage: BoolArray) -> ChartView:
    """Rectify a chart in the common exposure, within the camera's reach."""
    size = scene.placement.shape(chart)
    points = texel_points(scene, chart, np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    reach = camera_reach(camera.pose, WALL_REACH_M)
    is_near = np.linalg.norm(points - camera_position(camera.pose), axis=2) <= reach
    view = rectify_chart_from_panorama(scene, chart, camera.image, camera.pose, size, camera.occluded)
    return equalise_exposure(view, camera, coverage & is_near)


def chart_coverage_mask(scene: Scene, chart: int) -> BoolArray:
    """Return the texels (h, w) bool that a chart's triangles cover; the sky next to a gable is not covered."""
    import cv2

    drawn = np.zeros(scene.placement.shape(chart), np.uint8)
    mesh = scene.mesh
    corners = mesh.triangles[mesh.chart_triangles(chart)]
    flat = scene.charts.coordinates(np.full(corners.size, chart), mesh.vertices[corners].reshape(-1, 3))
    # OpenCV places the centre of the first texel at 0
    texels = np.rint((flat * scene.placement.texels_per_metre[chart] - 0.5) * 2**SUBTEXEL_BITS).astype(np.int32)
    for triangle in texels.reshape(-1, 3, 2):
        cv2.fillConvexPoly(drawn, triangle, 1, shift=SUBTEXEL_BITS)
    return drawn > 0
