"""Equirectangular projection of an upright street camera. Axes: geometry/README.md."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from facade_core.core.arrays import Float64Array
from facade_core.core.fixed_order import multiply_matrices


def upright_rotation(forward: Float64Array) -> Float64Array:
    """Return the camera_from_world rotation (3, 3) of an upright camera along the horizontal unit vector `forward` (2,)."""
    fx, fy = float(forward[0]), float(forward[1])
    return np.array([[fy, -fx, 0.0], [0.0, 0.0, -1.0], [fx, fy, 0.0]])


def panorama_rays(forward: Float64Array, width: int) -> Float64Array:
    """Return the world unit directions through the pixel centres, (width / 2, width, 3)."""
    return multiply_matrices(_camera_rays(width), upright_rotation(forward))


@lru_cache(maxsize=1)
def _camera_rays(width: int) -> Float64Array:
    """Return the same directions in camera axes, which all viewpoints of a block share."""
    height = width // 2
    longitude = ((np.arange(width) + 0.5) / width - 0.5) * 2 * np.pi
    latitude = (0.5 - (np.arange(height) + 0.5) / height) * np.pi
    cos_latitude = np.cos(latitude)[:, None]
    camera = np.empty((height, width, 3))
    camera[..., 0] = cos_latitude * np.sin(longitude)
    camera[..., 1] = -np.sin(latitude)[:, None]
    camera[..., 2] = cos_latitude * np.cos(longitude)
    camera.flags.writeable = False
    return camera
