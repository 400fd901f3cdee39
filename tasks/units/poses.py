"""The pose of one panorama, refined."""

from __future__ import annotations

import math
import time
from typing import Any

from facade_core.atlas.journal import Record
from facade_core.cameras.exposure import look_down
from facade_core.rectify import refine_pose
from tasks.run import Run
from tasks.units.context import plan_of_run, worker_name
from tasks.units.images import read_panorama
from tasks.units.unit import Piece


def pose_unit(run: Run, fork: Any, units: Piece) -> tuple[Any, dict[int, Record]]:
    """Refine the pose of one panorama against the block; returns the fork, to which nothing is written, and its record."""
    start = time.time()
    (unit,) = units
    (path,) = unit.arguments
    plan = plan_of_run(run)
    picture = read_panorama(path)
    found = refine_pose(plan.scene, picture, plan.poses[unit.index])
    pose = found.pose
    ground = look_down(plan.scene, picture, pose)
    record: Record = {
        "unit": unit.name,
        "key": unit.key,
        "status": "done",
        "pose": [pose.x, pose.y, pose.z, pose.heading, pose.pitch, pose.roll],
        "moved_m": round(found.moved_m, 3),
        "turned_deg": round(found.turned_deg, 3),
        # degrees between lines and axes on the rectified walls; None where there are no lines
        "given_deg": _number(found.given_degrees),
        "residual_deg": _number(found.residual_degrees),
        "left": list(found.reasons),
        "over_ground_m": ground.height,
        "squares": ground.squares,
        "worker": worker_name(),
        "started": start,
        "seconds": {"refine": round(time.time() - start, 4)},
    }
    return fork, {unit.index: record}


def _number(value: float) -> float | None:
    return round(value, 3) if math.isfinite(value) else None
