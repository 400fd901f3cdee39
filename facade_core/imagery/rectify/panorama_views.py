"""Perspective views of an unposed panorama to all sides, which are rectified as photos are."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from facade_core.core.arrays import UInt8Array
from facade_core.core.fixed_order import multiply_matrices
from facade_core.core.lens_projection import picture_rays
from facade_core.core.types import Lens, Pose
from facade_core.imagery.panorama_camera import (
    camera_from_world,
    is_in_view,
    pixels_per_radian,
    project_directions_to_picture,
)

# Views around a panorama. Neighbouring ones overlap: a narrow house is near the middle of one of them.
VIEW_COUNT = 8
# Width and height of a view in degrees, and its rise: from the street before the foot to the roofs across it.
FIELD_OF_VIEW_DEG = 80.0
VIEW_PITCH_DEG = 22.0
# Longest side of a view in pixels.
MAX_VIEW_SIDE_PX = 2400


@dataclass(frozen=True, slots=True, eq=False)
class PanoramaView:
    """Perspective view of a panorama.

    Attributes
    ----------
    heading : degrees clockwise from the panorama's middle.
    image : (h, w, 4) uint8, RGB with alpha 0 where the panorama has no pixel.
    focal : focal length in pixels.
    """

    heading: float
    image: UInt8Array
    focal: float


def cut_panorama_views(
    panorama: UInt8Array, view: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)
) -> Iterator[PanoramaView]:
    """Cut perspective views of a panorama to all sides, at its own resolution.

    Parameters
    ----------
    panorama : (H, W, 3) uint8, equirectangular and upright.
    view : (left, top, width, height) of the picture as shares of the full panorama.
    """
    import cv2

    height, width = panorama.shape[:2]
    own = Pose(0.0, 0.0, 0.0, 0.0, view=view)
    half = np.tan(np.radians(FIELD_OF_VIEW_DEG / 2))
    side = min(MAX_VIEW_SIDE_PX, round(2 * half * pixels_per_radian(own, width)))
    focal = side / 2 / half
    lens = Lens((side, side), (focal, focal), (side / 2, side / 2))
    rays = picture_rays(lens, (side, side))
    for heading in np.arange(VIEW_COUNT) * 360.0 / VIEW_COUNT:
        camera = replace(own, heading=float(heading), pitch=VIEW_PITCH_DEG)
        share = project_directions_to_picture(multiply_matrices(rays, camera_from_world(camera)), own)
        shown = is_in_view(share, own)
        if not shown.any():
            continue
        column = ((share[..., 0] - view[0]) % 1.0) / view[2] * width - 0.5
        row = (share[..., 1] - view[1]) / view[3] * height - 0.5
        image = cv2.remap(
            panorama,
            column.astype(np.float32),
            row.astype(np.float32),
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_WRAP if view[2] == 1 else cv2.BORDER_REPLICATE,
        )
        alpha = np.where(shown, 255, 0).astype(np.uint8)
        yield PanoramaView(float(heading), np.dstack([image, alpha]), focal)
