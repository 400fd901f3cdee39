"""The poses of panoramas, refined against the block before facades are taken from them."""

from __future__ import annotations

from catalogs.block import Block
from facade_core.atlas.journal import Record
from facade_core.atlas.zarr_types import StoreGroup
from facade_core.plan import Plan
from facade_core.types import Pose
from tasks.keys.memory import pose_memory
from tasks.keys.units import pose_key
from tasks.kinds.kind import Change, Kind, same_key_or_name
from tasks.run import Run
from tasks.units.poses import pose_unit
from tasks.units.unit import Unit


def pose_units(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit]:
    paths = [panorama.path for panorama in block.panoramas]
    return [
        Unit(i, path.name, (pose_key(run, plan, i, path),), (path,), pose_memory(path)) for i, path in enumerate(paths)
    ]


def refined(pose: Pose, record: Record | None) -> Pose:
    """The pose of a panorama as its record has it; the given one where it was not refined."""
    if record is None or record["status"] != "done":
        return pose
    x, y, z, heading, pitch, roll = record["pose"]
    return Pose(x, y, z, heading, pitch, roll, pose.view)


def is_refused(record: Record | None) -> bool:
    """Whether a panorama could not be placed: nothing is taken from it."""
    return record is not None and record["status"] == "failed"


def _again(change: Change) -> dict[int, int]:
    units = pose_units(change.run, change.block, change.after, change.group)
    return same_key_or_name(change.records["poses"], units)


POSES = Kind(
    "poses",
    "panorama",
    count=lambda block, plan: len(block.panoramas),
    again=_again,
    units=pose_units,
    function=pose_unit,
)
