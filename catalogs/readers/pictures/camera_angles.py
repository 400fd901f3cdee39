"""Heading, pitch and roll of a camera by its rotation."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from catalogs.printable_text import short_repr
from catalogs.readers.pictures.source_poses import MAX_MAGNITUDES, finite_number
from facade_core.core.arrays import Float64Array


def camera_angles_from_rotation(axis_angle: Iterable[float]) -> tuple[float, float, float]:
    """Return heading, pitch and roll of a camera in degrees by its rotation.

    Parameters
    ----------
    axis_angle : camera_from_world rotation vector in radians; the world is east, north, up.

    Raises
    ------
    ValueError
        For an invalid vector.
    """
    return camera_angles(rotation_matrix(axis_angle))


def rotation_matrix(axis_angle: Iterable[float]) -> Float64Array:
    """Return the camera_from_world rotation (3, 3) of an axis-angle vector in radians."""
    import cv2

    return np.asarray(cv2.Rodrigues(parse_vector(axis_angle).reshape(3, 1))[0], np.float64)


def parse_vector(values: Iterable[float]) -> Float64Array:
    """Return three finite numbers of a plausible size; ValueError for others."""
    found = np.array([finite_number(value, "a rotation or translation") for value in values], np.float64)
    if found.shape != (3,) or not (np.abs(found) <= MAX_MAGNITUDES["x"]).all():
        raise ValueError(f"{short_repr(found.tolist())} is no rotation or translation; three numbers are")
    return found


def camera_angles(camera_from_world: Float64Array) -> tuple[float, float, float]:
    """Return heading, pitch and roll in degrees of a camera: x right, y down, z forward; world east, north, up."""
    right, _, forward = camera_from_world
    heading = math.atan2(forward[0], forward[1])
    pitch = math.asin(min(max(forward[2], -1.0), 1.0))
    level = np.array([math.cos(heading), -math.sin(heading), 0.0])
    roll = math.atan2(-right @ np.cross(level, forward), right @ level)
    return math.degrees(heading) % 360.0, math.degrees(pitch), math.degrees(roll)
