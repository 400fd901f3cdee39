"""Projection of points into the panorama of an upright camera."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Float64Array
from facade_core.core.fixed_order import multiply_matrices
from facade_core.geometry.equirectangular import upright_rotation


def project_points_to_panorama(
    points: Float64Array, position: Float64Array, forward: Float64Array, width: int
) -> tuple[Float64Array, Float64Array]:
    """Project world points into a panorama.

    Parameters
    ----------
    points : (..., 3) metres.
    position : (3,) of the camera.
    forward : (2,) horizontal unit vector.
    width : panorama width in pixels.

    Returns
    -------
    (..., 2) pixel coordinates (u, v), and (...) range in metres.
    """
    camera = multiply_matrices(np.asarray(points) - position, upright_rotation(forward).T)
    distance = np.linalg.norm(camera, axis=-1)
    longitude = np.arctan2(camera[..., 0], camera[..., 2])
    latitude = np.arcsin(np.clip(-camera[..., 1] / np.maximum(distance, 1e-12), -1, 1))
    pixels = np.stack([(longitude / (2 * np.pi) + 0.5) * width, (0.5 - latitude / np.pi) * (width // 2)], axis=-1)
    return pixels, distance
