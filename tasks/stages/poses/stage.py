"""The poses of panoramas, refined against the block before facades are taken from them."""

from __future__ import annotations

import numpy as np
import shapely

from catalogs.block import Block
from facade_core.atlas.journal import Record
from facade_core.core.types import Pose
from facade_core.core.zarr_types import StoreGroup
from facade_core.imagery.poses.outlines import REACH_M
from facade_core.plan.plan import Plan
from tasks.engine.run import Run
from tasks.engine.stage import Change, Stage, same_key_or_name
from tasks.engine.unit import Unit
from tasks.stages.poses.worker import pose_unit
from tasks.stages.shared.key_parts import pose_key
from tasks.stages.shared.memory import pose_memory


def pose_units(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit]:
    units = []
    for i, (panorama, carried) in enumerate(zip(block.panoramas, heights_carried(block), strict=True)):
        key = pose_key(run, plan, i, panorama.path, carried)
        units.append(Unit(i, panorama.path.name, (key,), (panorama.path, carried), pose_memory(panorama.path)))
    return units


def heights_carried(block: Block) -> list[bool]:
    """Of each panorama, whether its height over the ground says more than the roofs around it: where no height is stated, or a
    roof in reach is as high as was guessed."""
    guessed = [building.footprint for building in block.buildings if building.height_source not in ("height", "model")]
    near = shapely.STRtree(guessed)
    poses = [panorama.pose for panorama in block.panoramas]
    places = shapely.points(np.array([(pose.x, pose.y) for pose in poses]).reshape(-1, 2))
    beside = set(near.query(places, predicate="dwithin", distance=REACH_M)[0].tolist())
    return [pose.z is None or i in beside for i, pose in enumerate(poses)]


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


POSES = Stage(
    "poses",
    "panorama",
    count=lambda block, plan: len(block.panoramas),
    match_previous=_again,
    units=pose_units,
    function=pose_unit,
)
