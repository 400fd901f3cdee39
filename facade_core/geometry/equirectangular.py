"""The equirectangular projection of an upright street camera. Axes: geometry/README.md."""

from __future__ import annotations

from functools import lru_cache

import numpy as np


def basis(forward: np.ndarray) -> np.ndarray:
    """camera_from_world rotation (3, 3) of an upright camera that looks along the horizontal unit vector `forward` (2,)."""
    fx, fy = float(forward[0]), float(forward[1])
    return np.array([[fy, -fx, 0.0], [0.0, 0.0, -1.0], [fx, fy, 0.0]])


def directions(forward: np.ndarray, width: int) -> np.ndarray:
    """World unit directions through the pixel centres: (width / 2, width, 3) float64."""
    return _of_camera(width) @ basis(forward)


@lru_cache(maxsize=1)
def _of_camera(width: int) -> np.ndarray:
    """The same in the camera's axes: every viewpoint of a block has them."""
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


def project(points: np.ndarray, position: np.ndarray, forward: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Where world points (..., 3) fall: pixel coordinates (..., 2) as (u, v), and their range in metres (...,)."""
    camera = (np.asarray(points) - position) @ basis(forward).T
    distance = np.linalg.norm(camera, axis=-1)
    longitude = np.arctan2(camera[..., 0], camera[..., 2])
    latitude = np.arcsin(np.clip(-camera[..., 1] / np.maximum(distance, 1e-12), -1, 1))
    pixels = np.stack([(longitude / (2 * np.pi) + 0.5) * width, (0.5 - latitude / np.pi) * (width // 2)], axis=-1)
    return pixels, distance
