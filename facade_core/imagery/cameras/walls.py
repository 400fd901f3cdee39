"""Walls that are no facades, and roofs, from posed panoramas: each texel from the camera that shows it best.

What stands before them is hidden first, by the parser, and so is the sky beside them. What two cameras show differently, by
parallax, is left to the material; what one camera alone shows is taken.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.geometry.overhead_view import raster_points
from facade_core.geometry.scene import Scene
from facade_core.imagery.cameras.agreement import compare_squares, squares_to_texels
from facade_core.imagery.cameras.camera_view import CameraView, PanoramaCamera, equalise_exposure, fuse_camera_views
from facade_core.imagery.poses.panorama_camera import WALL_REACH_M, position
from facade_core.imagery.rectify.fusion import View
from facade_core.imagery.rectify.panorama import rectify_view

# What one camera alone shows so far below itself may be a bicycle, a bin or a hedge before the wall, metres: cameras stand 2.5
# over the ground, and higher over that of a model which is too low.
BELOW_M = 1.3
# Of sub-texels that outlines are drawn in, bits.
SHIFT = 4


def fuse_wall_view(scene: Scene, chart: int, cameras: Sequence[PanoramaCamera]) -> CameraView | None:
    """A wall or a roof from panoramas; None where they show too little."""
    own = chart_coverage(scene, chart)
    views = [_view(scene, chart, camera, own) for camera in cameras]
    if not any(bool(view.clear.any()) for view in views):
        return None
    density = float(scene.placement.texels_per_metre[chart])
    low = [_low(scene, chart, camera) for camera in cameras]
    return fuse_camera_views(views, trusted_wall_texels(views, low, density), density)


def trusted_wall_texels(views: Sequence[View], is_low: Sequence[np.ndarray], density: float) -> list[np.ndarray]:
    """Which clear texels of each view are believed, (h, w) bool each; low (h, w) bool: where each alone is not; density in
    texels per metre."""
    squares, kept = compare_squares(views, density), []
    for i, view in enumerate(views):
        agreed, alone = (
            squares_to_texels(one, squares.side, view.seen.shape) for one in (squares.is_confirmed[i], squares.unconfirmed_squares(i))
        )
        kept.append(view.clear & (agreed | (alone & ~is_low[i])))
    return kept


def _low(scene: Scene, chart: int, camera: PanoramaCamera) -> np.ndarray:
    """The texels (h, w) bool of a chart that lie so far below a camera that things on the ground may stand before them."""
    rows, columns = (np.arange(int(n)) + 0.5 for n in (scene.placement.height[chart], scene.placement.width[chart]))
    return np.asarray(raster_points(scene, chart, rows, columns)[..., 2] < position(camera.pose)[2] - BELOW_M)


def _view(scene: Scene, chart: int, camera: PanoramaCamera, own: np.ndarray) -> View:
    """A chart as one camera shows it, in the common exposure, within WALL_REACH_M."""
    size = (int(scene.placement.height[chart]), int(scene.placement.width[chart]))
    points = raster_points(scene, chart, np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    near = np.linalg.norm(points - position(camera.pose), axis=2) <= WALL_REACH_M
    view = rectify_view(scene, chart, camera.image, camera.pose, size, camera.occluded)
    return equalise_exposure(view, camera, own & near)


def chart_coverage(scene: Scene, chart: int) -> np.ndarray:
    """The texels (h, w) bool of a chart that its triangles cover: beside a gable lies the sky."""
    import cv2

    drawn = np.zeros((int(scene.placement.height[chart]), int(scene.placement.width[chart])), np.uint8)
    mesh = scene.mesh
    corners = mesh.triangles[mesh.triangles_of(chart)]
    flat = scene.charts.coordinates(np.full(corners.size, chart), mesh.vertices[corners].reshape(-1, 3))
    # the middle of the first texel is 0 where pictures are drawn
    texels = np.rint((flat * scene.placement.texels_per_metre[chart] - 0.5) * 2**SHIFT).astype(np.int32)
    for triangle in texels.reshape(-1, 3, 2):
        cv2.fillConvexPoly(drawn, triangle, 1, shift=SHIFT)
    return drawn > 0
