"""Poses of panoramas as the journal has them."""

from __future__ import annotations

from facade_core.atlas.journal import Record
from facade_core.core.types import Pose


def select_pose(pose: Pose, record: Record | None) -> Pose:
    """The pose of a panorama as its record has it; the given one where it was not refined."""
    if record is None or record["status"] != "done":
        return pose
    x, y, z, heading, pitch, roll = record["pose"]
    return Pose(x, y, z, heading, pitch, roll, pose.view)


def is_refused(record: Record | None) -> bool:
    """Whether a panorama could not be placed: nothing is taken from it."""
    return record is not None and record["status"] == "failed"
