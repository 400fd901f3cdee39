"""Posed equirectangular pictures as cameras. Axes: geometry/README.md."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array
from facade_core.core.errors import GeometryError
from facade_core.core.types import Pose
from facade_core.geometry.equirectangular import upright_rotation

# Ground is taken from panoramas within this many metres: farther away, a pose error of one degree moves a kerb
# by metres.
GROUND_REACH_M = 15.0
# Limit for roofs and walls without a layout: farther away, such an error exceeds the compared squares.
WALL_REACH_M = 40.0


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
    """Compute the rotation (3, 3) of a panorama: heading clockwise from north, pitch up, roll clockwise."""
    heading, pitch, roll = np.radians([pose.heading, pose.pitch, pose.roll])
    upright = upright_rotation(np.array([np.sin(heading), np.cos(heading)]))
    pitched = np.array([[1, 0, 0], [0, np.cos(pitch), np.sin(pitch)], [0, -np.sin(pitch), np.cos(pitch)]])
    rolled = np.array([[np.cos(roll), np.sin(roll), 0], [-np.sin(roll), np.cos(roll), 0], [0, 0, 1]])
    rotation: Float64Array = rolled @ pitched @ upright
    return rotation


def project_directions_to_panorama(directions: Float64Array, pose: Pose) -> Float64Array:
    """Project world directions to the full panorama.

    Parameters
    ----------
    directions : (..., 3) in the world.
    pose : pose of the camera.

    Returns
    -------
    (..., 2) shares of width and height, from the top left.
    """
    camera = np.asarray(directions, np.float64) @ camera_from_world(pose).T
    longitude = np.arctan2(camera[..., 0], camera[..., 2])
    latitude = np.arctan2(-camera[..., 1], np.hypot(camera[..., 0], camera[..., 2]))
    return np.stack([longitude / (2 * np.pi) + 0.5, 0.5 - latitude / np.pi], axis=-1)


def is_in_view(share: Float64Array, pose: Pose) -> BoolArray:
    """Test whether shares of the full panorama are in the part that the picture contains.

    Parameters
    ----------
    share : (..., 2) shares of the full width and height.
    pose : pose with that part.

    Returns
    -------
    (...,) bool.
    """
    left, top, width, height = pose.view
    return ((share[..., 0] - left) % 1.0 < width) & (share[..., 1] >= top) & (share[..., 1] < top + height)


def rotate_pose(pose: Pose, turn: Float64Array) -> Pose:
    """Rotate a pose, so that world directions d of `pose` become turn (3, 3) @ d."""
    from scipy.spatial.transform import Rotation

    world_from_camera = turn @ camera_from_world(pose).T
    axes = world_from_camera @ np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # right, ahead, up
    heading, pitch, roll = Rotation.from_matrix(axes).as_euler("ZXY", degrees=True)
    return replace(pose, heading=float(-heading % 360), pitch=float(pitch), roll=float(roll))
