"""Ground charts from posed panoramas: each texel from the camera that shows it best, where cameras agree on what it is.

What is not in the model (cars, people, kerbs, the camera's own vehicle) lies elsewhere on the ground for each camera, by
parallax: squares in which cameras contradict each other are left to the material.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.core.types import Pose
from facade_core.geometry.scene import Scene
from facade_core.imagery.cameras.agreement import compare_squares, find_thin_objects, squares_to_texels
from facade_core.imagery.cameras.camera_view import CameraView, PanoramaCamera, equalise_exposure, fuse_camera_views
from facade_core.imagery.poses.panorama_camera import GROUND_REACH_M, position
from facade_core.imagery.rectify.fusion import View
from facade_core.imagery.rectify.panorama import rectify_view

# A camera shows ground from so near, metres: nearer its own vehicle is in the way.
NEAR_M = 3.4
# What one camera alone shows nearer than this may be its own vehicle, metres.
ALONE_M = 7.0
# A camera is believed where it is alone if so many squares of the piece, and this share of those that it shows with others,
# are agreed on: no camera without neighbours is, whose ground would be a ring around it.
VOUCHED, VOUCHED_SHARE = 24, 0.5
# What one camera alone shows is ground where it is no farther off the usual colour around that camera than this, or than so
# many times what half of the ground is off.
ODD, OFTEN = 0.35, 3.0
# So far around a square that is not believed, metres, no square is: what stands there reaches over its border.
BESIDE_M = 0.3


def fuse_ground_view(scene: Scene, chart: int, cameras: Sequence[PanoramaCamera]) -> CameraView | None:
    """A chart of the ground from panoramas; None where they show too little.

    A square that several cameras show is taken from those that agree with another one; what one alone shows is taken where it
    is far enough from the camera and of the usual colour, and others agree with that camera beside it.
    """
    views = [_view(scene, chart, camera) for camera in cameras]
    if not any(bool(view.clear.any()) for view in views):
        return None
    density = float(scene.placement.texels_per_metre[chart])
    away = [_away(scene, chart, camera.pose) for camera in cameras]
    return fuse_camera_views(views, trusted_ground_texels(views, away, [_usual(camera) for camera in cameras], density), density)


def trusted_ground_texels(
    views: Sequence[View],
    distance: Sequence[np.ndarray],
    ground_colours: Sequence[tuple[np.ndarray, np.ndarray] | None],
    density: float,
) -> list[np.ndarray]:
    """Which clear texels of each view are believed, (h, w) bool each.

    away (h, w): metres from the camera; usual: as of `typical_ground_colour`, in the views' exposure; density in texels per metre.
    """
    import cv2

    squares, kept, rim = compare_squares(views, density), [], round(BESIDE_M * density)
    for i, view in enumerate(views):
        supported, opposed, alone = squares.is_confirmed[i], squares.is_contradicted[i], squares.unconfirmed_squares(i)
        like = ground_colours[i]
        agreed = int(supported.sum())
        if like is None or agreed < VOUCHED or agreed < VOUCHED_SHARE * (supported | opposed).sum():
            alone[:] = False
        else:
            middle, half = like
            alone &= (np.abs(squares.log_colour[i] - middle) <= np.maximum(ODD, OFTEN * half)).all(axis=2)
        doubted = squares.is_usable[i] & ~supported & ~alone
        whole = [squares_to_texels(square, squares.side, view.seen.shape) for square in (supported, alone, doubted)]
        beside = cv2.dilate(whole[2].astype(np.uint8), np.ones((2 * rim + 1,) * 2, np.uint8)) > 0
        kept.append(view.clear & (whole[0] | (whole[1] & (distance[i] >= ALONE_M))) & ~beside)
    return [one & ~odd for one, odd in zip(kept, find_thin_objects(views, density), strict=True)]


def _view(scene: Scene, chart: int, camera: PanoramaCamera) -> View:
    """A chart as one camera shows it, in the common exposure, from NEAR_M to GROUND_REACH_M."""
    size = (int(scene.placement.height[chart]), int(scene.placement.width[chart]))
    away = _away(scene, chart, camera.pose)
    view = rectify_view(scene, chart, camera.image, camera.pose, size, camera.occluded)
    return equalise_exposure(view, camera, (away >= NEAR_M) & (away <= GROUND_REACH_M))


def _away(scene: Scene, chart: int, pose: Pose) -> np.ndarray:
    """How far each texel of a chart is from the foot of a camera, (h, w) float32 metres."""
    charts, step = scene.charts, 1 / float(scene.placement.texels_per_metre[chart])
    place = position(pose)
    x = (np.arange(int(scene.placement.width[chart]), dtype=np.float32) + 0.5) * step
    y = (np.arange(int(scene.placement.height[chart]), dtype=np.float32) + 0.5) * step
    corner = (charts.origin[chart] - place)[:2]
    across, down = charts.axis_u[chart][:2], charts.axis_v[chart][:2]
    east = corner[0] + across[0] * x[None] + down[0] * y[:, None]
    north = corner[1] + across[1] * x[None] + down[1] * y[:, None]
    return np.hypot(east, north).astype(np.float32)


def _usual(camera: PanoramaCamera) -> tuple[np.ndarray, np.ndarray] | None:
    """In the common exposure."""
    return None if camera.ground_colour is None else (camera.ground_colour[0] + np.log(camera.exposure_factor), camera.ground_colour[1])
