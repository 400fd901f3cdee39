"""Worker of `bundles`: refine the poses of panoramas that show the same walls together."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from facade_core.core.types import Pose
from facade_core.geometry.scene import Scene
from facade_core.imagery.cameras.exposure import sample_ground_colours
from facade_core.imagery.panorama_camera import camera_from_world, camera_position, rotation_angle_deg
from facade_core.imagery.poses.joint_refinement import JointPose, PriorPose, refine_jointly
from tasks.engine.inputs import GEOMETRY_CHANGED, PANORAMAS_CHANGED, input_field
from tasks.stages.bundles.record import BundledPose, PoseFieldsFromBundle
from tasks.stages.poses.record import pose_values, round_finite
from tasks.stages.shared.images import max_picture_pixels, read_panorama
from tasks.stages.shared.scene_view import SceneView


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


@dataclass(frozen=True)
class BundleInputs:
    """Inputs of panoramas that are refined together.

    Attributes
    ----------
    members : the panoramas, with the poses refined alone.
    surfaces : charts that they are refined on.
    around : what of the block they may be matched with.
    """

    members: tuple[BundlePanorama, ...] = input_field(PANORAMAS_CHANGED)
    surfaces: SceneView = input_field(GEOMETRY_CHANGED)
    around: SceneView = input_field(GEOMETRY_CHANGED)


def compute_bundle(inputs: BundleInputs) -> dict[str, BundledPose]:
    """Refine the poses of some panoramas together; returns the result by name of each panorama."""
    members, scene = inputs.members, inputs.around.scene
    if len(members) < 2:
        return {}
    images = (read_panorama(one.path, max_picture_pixels(one.given)) for one in members)
    found = refine_jointly(scene, inputs.surfaces.charts, images, [one.alone for one in members])
    return {
        one.path.name: {"alone": pose_values(one.alone.pose), "found": _refined_fields(scene, one, at)}
        for one, at in zip(members, found, strict=True)
    }


def bundle_record_fields(_atlas: object, _unit: object, result: dict[str, BundledPose]) -> dict[str, object]:
    """Return the fields of the record of a bundle; its poses are kept nowhere else."""
    return {"together": result}


def _refined_fields(scene: Scene, one: BundlePanorama, found: JointPose) -> PoseFieldsFromBundle:
    """Return the fields of a panorama's record that the bundle replaces; without a new pose how far the others are off."""
    told: PoseFieldsFromBundle = {
        "shared": found.surfaces,
        "apart_before_m": round_finite(found.distance_before),
        "apart_m": round_finite(found.distance_after),
        "kept_alone": found.reason,
    }
    if found.reason:
        return told
    ground = sample_ground_colours(scene, read_panorama(one.path, max_picture_pixels(one.given)), found.pose)
    turn = camera_from_world(found.pose) @ camera_from_world(one.given).T
    return told | {
        "pose": pose_values(found.pose),
        "moved_m": round_finite(float(np.linalg.norm(camera_position(found.pose) - camera_position(one.given)))),
        "turned_deg": round_finite(rotation_angle_deg(turn)),
        "residual_deg": round_finite(found.residual_degrees),
        "fit": None,  # that is of the pose refined alone
        "over_ground_m": ground.height,
        "squares": ground.squares,
    }
