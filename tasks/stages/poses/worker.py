"""Worker of `poses`: refine the pose of one panorama."""

from __future__ import annotations

import math
import time
from typing import cast

from icechunk import ForkSession

from facade_core.atlas.journal import Record
from facade_core.core.errors import ImageError
from facade_core.core.types import Pose
from facade_core.imagery.cameras.exposure import sample_ground_colours
from facade_core.imagery.poses.misplaced import explain_misplacement
from facade_core.imagery.poses.outlines import sample_visible_outlines
from facade_core.imagery.poses.refinement import refine_pose
from facade_core.imagery.rectify.full_circle import check_full_panorama
from tasks.engine.context import current_worker_name, load_run_plan
from tasks.engine.run import Run
from tasks.engine.unit import Unit, UnitGroup
from tasks.stages.poses.record import PoseRecord
from tasks.stages.shared.images import max_picture_pixels, read_panorama

# Fit of building outlines, 0 to 1, above which a pose is trusted. Correct poses on painted streets fit from 0.57 on.
MIN_TRUSTED_FIT = 0.5


def process_pose(run: Run, fork: ForkSession, units: UnitGroup) -> tuple[ForkSession, dict[int, Record]]:
    """Refine the pose of one panorama against the block; returns the unchanged fork and the record.

    Raises
    ------
    ImageError : the picture is no panorama, or was not taken as its pose says.
    """
    start = time.time()
    (unit,) = units
    path, carried, is_used = unit.arguments
    plan = load_run_plan(run)
    given = plan.poses[unit.index]
    if not is_used:
        return fork, {unit.index: _unused_record(unit, given, start)}
    picture = read_panorama(path, max_picture_pixels(given))
    if given.lens is None and given.view == (0.0, 0.0, 1.0, 1.0):
        check_full_panorama(picture)
    found = refine_pose(plan.scene, picture, given, height_is_assumed=carried)
    pose = found.pose
    if not found.fit >= MIN_TRUSTED_FIT:  # nor where nothing tells
        fitting = found.fit if math.isfinite(found.fit) else 0.0
        if why := explain_misplacement(plan.scene, picture, pose, sample_visible_outlines(plan.scene, pose), fitting):
            raise ImageError(why)
    ground = sample_ground_colours(plan.scene, picture, pose)
    record: PoseRecord = {
        "unit": unit.name,
        "key": unit.key,
        "status": "done",
        "pose": _pose_values(pose),
        "moved_m": round(found.moved_m, 3),
        "turned_deg": round(found.turned_deg, 3),
        # degrees between lines and axes on the rectified walls; None where there are no lines
        "given_deg": _round_finite(found.given_degrees),
        "residual_deg": _round_finite(found.residual_degrees),
        "left": list(found.reasons),
        "spread": None if found.covariance is None else found.covariance.round(6).tolist(),
        "over_ground_m": ground.height,
        "squares": ground.squares,
        "worker": current_worker_name(),
        "started": start,
        "seconds": {"refine": round(time.time() - start, 4)},
    }
    return fork, {unit.index: record}


def _unused_record(unit: Unit, given: Pose, start: float) -> PoseRecord:
    """Return the record of a panorama that no surface is taken from."""
    return {
        "unit": unit.name,
        "key": unit.key,
        "status": "done",
        "pose": _pose_values(given),
        "moved_m": 0.0,
        "turned_deg": 0.0,
        "given_deg": None,
        "residual_deg": None,
        "left": ["no surface is taken from it"],
        "spread": None,
        "over_ground_m": None,
        "squares": [],
        "is_unused": True,
        "worker": current_worker_name(),
        "started": start,
        "seconds": {},
    }


def _pose_values(pose: Pose) -> list[float]:
    return [pose.x, pose.y, cast(float, pose.z), pose.heading, pose.pitch, pose.roll]


def _round_finite(value: float) -> float | None:
    return round(value, 3) if math.isfinite(value) else None
