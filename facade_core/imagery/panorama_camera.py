"""Posed pictures as cameras: equirectangular panoramas, and pictures of a lens. Axes: geometry/README.md."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, FloatArray
from facade_core.core.errors import GeometryError
from facade_core.core.fixed_order import multiply_matrices
from facade_core.core.lens_projection import project_camera_rays
from facade_core.core.types import Pose
from facade_core.geometry.equirectangular import upright_rotation

# Ground is taken from panoramas within this many metres: farther away, a pose error of one degree moves a kerb
# by metres.
GROUND_REACH_M = 15.0
# Limit for roofs and walls without a layout: farther away, such an error exceeds the compared squares.
WALL_REACH_M = 40.0
# Aerial pictures have poses by photogrammetry: they reach to the distance at which a metre has so many of their pixels.
MIN_AERIAL_PIXELS_PER_METRE = 6.0
# Turn, in pixels, of pictures that do not continue across their border: larger than any picture.
NO_TURN_PX = 1e12


def camera_position(pose: Pose) -> Float64Array:
    """Return the camera's position (3,) in world metres.

    Raises
    ------
    GeometryError
        If the pose has no height.
    """
    if pose.z is None:
        raise GeometryError(f"the pose at {pose.x:.1f}, {pose.y:.1f} has no height; put it on the terrain first")
    return np.array([pose.x, pose.y, pose.z], np.float64)


def camera_from_world(pose: Pose) -> Float64Array:
    """Compute the rotation (3, 3) of a camera: heading clockwise from north, pitch up, roll clockwise."""
    heading, pitch, roll = np.radians([pose.heading, pose.pitch, pose.roll])
    upright = upright_rotation(np.array([np.sin(heading), np.cos(heading)]))
    pitched = np.array([[1, 0, 0], [0, np.cos(pitch), np.sin(pitch)], [0, -np.sin(pitch), np.cos(pitch)]])
    rolled = np.array([[np.cos(roll), np.sin(roll), 0], [-np.sin(roll), np.cos(roll), 0], [0, 0, 1]])
    return multiply_matrices(multiply_matrices(rolled, pitched), upright)


def project_directions_to_picture(directions: Float64Array, pose: Pose) -> Float64Array:
    """Project world directions to the full panorama, or to the picture of a lens.

    Parameters
    ----------
    directions : (..., 3) in the world.
    pose : pose of the camera.

    Returns
    -------
    (..., 2) shares of width and height, from the top left; NaN where a lens does not show the direction.
    """
    if pose.lens is not None:
        return project_camera_rays(pose.lens, multiply_matrices(directions, camera_from_world(pose).T))
    camera = multiply_matrices(directions, camera_from_world(pose).T)
    longitude = np.arctan2(camera[..., 0], camera[..., 2])
    latitude = np.arctan2(-camera[..., 1], np.hypot(camera[..., 0], camera[..., 2]))
    return np.stack([longitude / (2 * np.pi) + 0.5, 0.5 - latitude / np.pi], axis=-1)


def is_in_view(share: Float64Array, pose: Pose) -> BoolArray:
    """Test whether shares of the full panorama, or of the picture of a lens, are in what the picture contains.

    Parameters
    ----------
    share : (..., 2) shares of the full width and height.
    pose : pose with that part.

    Returns
    -------
    (...,) bool.
    """
    if pose.lens is not None:
        return np.asarray(((share >= 0) & (share < 1)).all(axis=-1))
    left, top, width, height = pose.view
    return ((share[..., 0] - left) % 1.0 < width) & (share[..., 1] >= top) & (share[..., 1] < top + height)


def rotate_pose(pose: Pose, turn: Float64Array) -> Pose:
    """Rotate a pose, so that world directions d of `pose` become turn (3, 3) @ d."""
    from scipy.spatial.transform import Rotation

    world_from_camera = turn @ camera_from_world(pose).T
    axes = world_from_camera @ np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # right, ahead, up
    heading, pitch, roll = Rotation.from_matrix(axes).as_euler("ZXY", degrees=True)
    return replace(pose, heading=float(-heading % 360), pitch=float(pitch), roll=float(roll))


def rotation_angle_deg(turn: Float64Array) -> float:
    """Return the angle of a rotation (3, 3), degrees."""
    return float(np.degrees(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1))))


def rotation_about_z(degrees: float) -> Float64Array:
    """Return the rotation (3, 3) about the vertical, counter-clockwise from above."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])


def camera_reach(pose: Pose, reach: float) -> float:
    """Return the distance in metres up to which a camera is used: `reach`, for an aerial picture as far as it is sharp."""
    if pose.lens is None or not pose.is_aerial:
        return reach
    return max(reach, min(pose.lens.focal) / MIN_AERIAL_PIXELS_PER_METRE)


def pixels_per_radian(pose: Pose, width: int) -> float:
    """Return the resolution of a picture `width` pixels wide: of a panorama everywhere, of a lens on its axis."""
    if pose.lens is None:
        return width / pose.view[2] / (2 * np.pi)
    return pose.lens.focal[0] * width / pose.lens.size[0]


def pixels_per_radian_along(pose: Pose, width: int, rays: Float64Array) -> FloatArray | float:
    """Return the resolution (n,) along world rays (n, 3), or that of all: a perspective lens widens towards its border."""
    middle = pixels_per_radian(pose, width)
    if pose.lens is None or pose.lens.fisheye:
        return middle
    cosine = multiply_matrices(rays, camera_from_world(pose)[2]) / np.maximum(np.linalg.norm(rays, axis=-1), 1e-9)
    return np.asarray(middle * np.maximum(cosine, 1e-2) ** -1.5)


def is_any_in_view(pose: Pose, points: Float64Array) -> bool:
    """Report whether a camera may show one of the world points (n, 3): a panorama always."""
    if pose.lens is None:
        return True
    return bool(is_in_view(project_directions_to_picture(points - camera_position(pose), pose), pose).any())
