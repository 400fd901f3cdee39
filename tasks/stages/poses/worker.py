"""Worker of `poses`: refine the pose of one panorama."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from facade_core.core.errors import ImageError
from facade_core.core.types import Pose
from facade_core.imagery.cameras.exposure import sample_ground_colours
from facade_core.imagery.poses.misplaced import explain_misplacement
from facade_core.imagery.poses.outlines import sample_visible_outlines
from facade_core.imagery.poses.refinement import refine_pose
from facade_core.imagery.poses.settings import REFINEMENT
from facade_core.imagery.rectify.full_circle import check_full_panorama
from tasks.engine.inputs import GEOMETRY_CHANGED, PICTURE_CHANGED, input_field
from tasks.stages.poses.record import pose_values, round_finite
from tasks.stages.shared.images import max_picture_pixels, read_panorama
from tasks.stages.shared.scene_view import SceneView


@dataclass(frozen=True)
class PoseInputs:
    """Inputs of the refinement of a panorama's pose.

    Attributes
    ----------
    picture : the panorama.
    given : its pose as stated.
    is_height_assumed : whether height over ground is trusted more than the roofs.
    is_used : whether a surface would be taken from it.
    around : what of the block it may be matched with.
    """

    picture: Path = input_field(PICTURE_CHANGED)
    given: Pose = input_field("pose changed")
    is_height_assumed: bool = input_field("pose changed")
    is_used: bool = input_field("pose changed")
    around: SceneView = input_field(GEOMETRY_CHANGED)


# Fields of a record of a pose.
PoseFields = dict[str, object]


def compute_pose(inputs: PoseInputs) -> PoseFields:
    """Refine the pose of a panorama against the block.

    Raises
    ------
    ImageError : the picture is no panorama, or was not taken as its pose says.
    """
    given = inputs.given
    if not inputs.is_used:
        return _unused_fields(given)
    picture, scene = read_panorama(inputs.picture, max_picture_pixels(given)), inputs.around.scene
    if given.lens is None and given.view == (0.0, 0.0, 1.0, 1.0):
        check_full_panorama(picture)
    found = refine_pose(scene, picture, given, height_is_assumed=inputs.is_height_assumed)
    pose = found.pose
    if not found.fit >= REFINEMENT.min_fit:  # nor where nothing tells
        fitting = found.fit if math.isfinite(found.fit) else 0.0
        if why := explain_misplacement(scene, picture, pose, sample_visible_outlines(scene, pose), fitting):
            raise ImageError(why)
    ground = sample_ground_colours(scene, picture, pose)
    return {
        "pose": pose_values(pose),
        "moved_m": round(found.moved_m, 3),
        "turned_deg": round(found.turned_deg, 3),
        # degrees between lines and axes on the rectified walls; None where there are no lines
        "given_deg": round_finite(found.given_degrees),
        "residual_deg": round_finite(found.residual_degrees),
        "given_fit": round_finite(found.given_fit),
        "fit": round_finite(found.fit),
        "left": list(found.reasons),
        "spread": None if found.covariance is None else found.covariance.round(6).tolist(),
        "over_ground_m": ground.height,
        "squares": ground.squares,
    }


def record_fields(_atlas: object, _unit: object, result: PoseFields) -> PoseFields:
    """Return the fields of a record; a pose is kept nowhere else."""
    return result


def _unused_fields(given: Pose) -> PoseFields:
    """Return the fields of a panorama that no surface is taken from."""
    return {
        "pose": pose_values(given),
        "moved_m": 0.0,
        "turned_deg": 0.0,
        "given_deg": None,
        "residual_deg": None,
        "given_fit": None,
        "fit": None,
        "left": ["no surface is taken from it"],
        "spread": None,
        "over_ground_m": None,
        "squares": [],
        "is_unused": True,
    }
