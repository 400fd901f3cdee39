"""Perspective views of panoramas and of pictures without distortion."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from facade_core.core.types import Pose
from facade_core.export.pictures.camera import PerspectiveCamera
from facade_core.imagery.panorama_camera import camera_position, project_directions_to_picture

# Views of a panorama: headings around it, and the field of view of each, degrees.
HEADINGS, FIELD_OF_VIEW_DEG = 8, 90.0
# Pitches of the views, degrees: level, and upwards to roofs.
PITCHES_DEG = (0.0, 40.0)


def perspective_cameras(pose: Pose, size: int, *, pitches: Sequence[float] = PITCHES_DEG) -> list[PerspectiveCamera]:
    """Return the cameras of views around a panorama, `size` pixels a side."""
    place = camera_position(pose)
    return [
        PerspectiveCamera.from_heading(
            place, heading=number * 360 / HEADINGS, pitch=pitch, field_of_view=FIELD_OF_VIEW_DEG, size=(size, size)
        )
        for pitch in pitches
        for number in range(HEADINGS)
    ]


def cut_view(image: np.ndarray, pose: Pose, rays: np.ndarray) -> np.ndarray:
    """Return what a picture shows along world rays (h, w, 3), as (h, w, channels)."""
    share = project_directions_to_picture(rays, pose)
    left, top, width, height = pose.view
    rows, columns = image.shape[:2]
    x = ((share[..., 0] - left) % 1.0 / width * columns - 0.5).astype(np.float32)
    y = ((share[..., 1] - top) / height * rows - 0.5).astype(np.float32)
    return cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
