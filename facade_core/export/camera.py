"""Perspective cameras for pictures of a block."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facade_core.geometry.streets import Viewpoint
from facade_core.street.scene import Scene

# Free space around the block in the aerial picture.
FRAME = 1.04


@dataclass(frozen=True)
class Camera:
    """A pinhole camera: position and target (3,) metres, horizontal field of view in degrees, size = (height, width)."""

    position: np.ndarray
    target: np.ndarray
    field_of_view: float
    size: tuple[int, int]

    def rays(self) -> np.ndarray:
        """World unit directions through the pixel centres, (h, w, 3)."""
        height, width = self.size
        forward = self.target - self.position
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right = right / np.linalg.norm(right)
        down = np.cross(forward, right)
        focal = width / 2 / np.tan(np.radians(self.field_of_view) / 2)
        x = (np.arange(width) + 0.5 - width / 2) / focal
        y = (np.arange(height) + 0.5 - height / 2) / focal
        rays = forward + x[None, :, None] * right + y[:, None, None] * down
        return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


def aerial(scene: Scene, size: tuple[int, int]) -> Camera:
    """The block from above, obliquely from the south-west: the whole of its buildings in view."""
    built = scene.charts.building[scene.mesh.vertex_chart] >= 0
    points = scene.mesh.vertices[built] if built.any() else scene.mesh.vertices
    target = (points.min(axis=0) + points.max(axis=0)) / 2
    away = np.array([-0.45, -0.62, 0.64])
    away /= np.linalg.norm(away)
    right = np.cross(-away, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    up = np.cross(away, right)
    field_of_view = 38.0
    half_width = np.tan(np.radians(field_of_view) / 2) / FRAME
    half_height = half_width * size[0] / size[1]
    for _ in range(8):  # the nearer side spreads more, so the middle of the picture is found by steps
        relative = points - target
        across, along, nearer = relative @ right, relative @ up, relative @ away
        distance = float((np.maximum(np.abs(across) / half_width, np.abs(along) / half_height) + nearer).max())
        depth = distance - nearer
        middle = [(np.ptp(s) / 2 + s.min()) * distance for s in (across / depth, along / depth)]
        target = target + middle[0] * right + middle[1] * up
    return Camera(target + away * distance, target, field_of_view, size)


def street_level(viewpoint: Viewpoint, size: tuple[int, int]) -> Camera:
    """Looking along the street from a viewpoint, slightly upwards."""
    ahead = np.array([*viewpoint.forward, 0.14])
    return Camera(viewpoint.position, viewpoint.position + ahead, 84.0, size)
