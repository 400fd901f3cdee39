"""Worker of `bundles`: refine the poses of panoramas that show the same walls together."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import NamedTuple, cast

import numpy as np
from icechunk import ForkSession

from facade_core.atlas.journal import Record
from facade_core.core.types import Pose
from facade_core.geometry.scene import Scene
from facade_core.imagery.cameras.exposure import sample_ground_colours
from facade_core.imagery.panorama_camera import camera_from_world, camera_position
from facade_core.imagery.poses.joint_refinement import JointPose, PriorPose, refine_jointly
from tasks.engine.context import current_worker_name, load_run_plan
from tasks.engine.run import Run
from tasks.engine.unit import UnitGroup
from tasks.stages.bundles.record import BundledPose, BundleRecord, PoseFieldsFromBundle
from tasks.stages.shared.images import max_picture_pixels, read_panorama


class BundlePanorama(NamedTuple):
    """A panorama of a bundle.

    Attributes
    ----------
    path : its file.
    given : stated pose.
    alone : pose refined alone.
    """

    path: Path
    given: Pose
    alone: PriorPose


def process_bundle(run: Run, fork: ForkSession, units: UnitGroup) -> tuple[ForkSession, dict[int, Record]]:
    """Refine the poses of one bundle together; returns the unchanged fork and the record."""
    start = time.time()
    (unit,) = units
    members, surfaces = unit.arguments
    scene = load_run_plan(run).scene
    together: dict[str, BundledPose] = {}
    if len(members) > 1:
        images = (read_panorama(one.path, max_picture_pixels(one.given)) for one in members)
        found = refine_jointly(scene, surfaces, images, [one.alone for one in members])
        together = {
            one.path.name: {"alone": _pose_values(one.alone.pose), "found": _refined_fields(scene, one, at)}
            for one, at in zip(members, found, strict=True)
        }
    record: BundleRecord = {
        "unit": unit.name,
        "key": unit.key,
        "status": "done",
        "together": together,
        "worker": current_worker_name(),
        "started": start,
        "seconds": {"refine": round(time.time() - start, 4)},
    }
    return fork, {unit.index: record}


def _refined_fields(scene: Scene, one: BundlePanorama, found: JointPose) -> PoseFieldsFromBundle:
    """Return the fields of a panorama's record that the bundle replaces; without a new pose how far the others are off."""
    told: PoseFieldsFromBundle = {
        "shared": found.surfaces,
        "apart_before_m": _round_finite(found.distance_before),
        "apart_m": _round_finite(found.distance_after),
        "kept_alone": found.reason,
    }
    if found.reason:
        return told
    ground = sample_ground_colours(scene, read_panorama(one.path, max_picture_pixels(one.given)), found.pose)
    turn = camera_from_world(found.pose) @ camera_from_world(one.given).T
    return told | {
        "pose": _pose_values(found.pose),
        "moved_m": _round_finite(float(np.linalg.norm(camera_position(found.pose) - camera_position(one.given)))),
        "turned_deg": _round_finite(float(np.degrees(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1))))),
        "residual_deg": _round_finite(found.residual_degrees),
        "over_ground_m": ground.height,
        "squares": ground.squares,
    }


def _pose_values(pose: Pose) -> list[float]:
    # a refined pose has a height
    return [pose.x, pose.y, cast(float, pose.z), pose.heading, pose.pitch, pose.roll]


def _round_finite(value: float) -> float | None:
    return round(value, 3) if math.isfinite(value) else None
