"""Worker of `poses`: refine the pose of one panorama."""

from __future__ import annotations

import math
import time
from typing import cast

from icechunk import ForkSession

from facade_core.atlas.journal import Record
from facade_core.core.errors import ImageError
from facade_core.imagery.cameras.exposure import sample_ground_colours
from facade_core.imagery.poses.misplaced import explain_misplacement
from facade_core.imagery.poses.outlines import sample_visible_outlines
from facade_core.imagery.poses.refinement import refine_pose
from facade_core.imagery.rectify.full_circle import check_full_panorama
from tasks.engine.context import current_worker_name, load_run_plan
from tasks.engine.run import Run
from tasks.engine.unit import UnitGroup
from tasks.stages.poses.record import PoseRecord
from tasks.stages.shared.images import read_panorama

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
    path, carried = unit.arguments
    plan = load_run_plan(run)
    picture, given = read_panorama(path), plan.poses[unit.index]
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
        "pose": [pose.x, pose.y, cast(float, pose.z), pose.heading, pose.pitch, pose.roll],
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


def _round_finite(value: float) -> float | None:
    return round(value, 3) if math.isfinite(value) else None
