"""Records of panoramas."""

from __future__ import annotations

import math
from typing import cast

from facade_core.atlas.journal import Record
from facade_core.core.types import Pose


class PoseRecord(Record, total=False):
    """Record of a panorama whose pose was refined.

    Attributes
    ----------
    pose : x, y, z, metres; heading, pitch, roll, degrees.
    moved_m : distance from the given place, metres.
    turned_deg : turn from the given pose, degrees.
    given_deg : angle between lines and axes on the rectified walls with the given pose, degrees; None without lines.
    residual_deg : the same with the refined pose.
    given_fit : fit of the outlines of buildings to edges of the picture, 0 to 1, at the given place; None without outlines.
    fit : the same at the refined place.
    left : why parts of the pose were not refined.
    spread : covariance of place and heading (metres, degrees) by outlines of buildings; None if they do not determine it.
    over_ground_m : height over the ground, metres; None where the block has no ground there.
    squares : colours of squares of ground around it.
    is_unused : no surface would be taken from it; its pose is as stated.
    """

    pose: list[float]
    moved_m: float
    turned_deg: float
    given_deg: float | None
    residual_deg: float | None
    given_fit: float | None
    fit: float | None
    left: list[str]
    spread: list[list[float]] | None
    over_ground_m: float | None
    squares: list[list[int]]
    is_unused: bool


class BundledPoseRecord(PoseRecord, total=False):
    """Record of a panorama with the result of its bundle.

    Attributes
    ----------
    shared : surfaces on which other panoramas agree.
    kept_alone : why the pose refined alone is kept.
    apart_before_m : median distance between the same points in several panoramas before, metres.
    apart_m : the same distance after.
    """

    shared: int
    kept_alone: str
    apart_before_m: float | None
    apart_m: float | None


def pose_values(pose: Pose) -> list[float]:
    """Return a pose with a height, as its record holds it."""
    return [pose.x, pose.y, cast(float, pose.z), pose.heading, pose.pitch, pose.roll]


def round_finite(value: float) -> float | None:
    """Return a number as a record holds it; None for infinity and NaN."""
    return round(value, 3) if math.isfinite(value) else None
