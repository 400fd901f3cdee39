"""Stage `poses`: refine the poses of panoramas before facades are taken from them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely

from catalogs.block.reader import Block
from facade_core.core.zarr_types import StoreGroup
from facade_core.imagery.poses.settings import OUTLINES
from facade_core.plan.plan import Plan
from tasks.engine.run import Run
from tasks.engine.stage import Stage, UnitOutline
from tasks.engine.unit import Unit
from tasks.stages.poses.worker import PoseInputs, compute_pose, record_fields
from tasks.stages.shared.memory import LIBRARY_BYTES, bounded_pixel_count, peak_decoding_bytes
from tasks.stages.shared.picture_choice import choose_pictures
from tasks.stages.shared.scene_view import SceneView
from tasks.stages.shared.view_inputs import POSE_SURROUNDINGS_M

# Bytes per pixel of a panorama whose pose is refined: the picture, and edges of it at a smaller size.
POSE_PIXEL = 24


def list_pose_units(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit[PoseInputs]]:
    """List the units of stage `poses`: one for each panorama, one that no surface is taken from with little to do."""
    units, chosen = [], choose_pictures(plan, block)
    for i, (panorama, carried) in enumerate(zip(block.panoramas, ground_height_preferred_flags(block), strict=True)):
        is_used = i in chosen
        pose = plan.poses[i]
        place = np.array([pose.x, pose.y, pose.z])
        around = plan.scene_objects.digests_in_box(place - POSE_SURROUNDINGS_M, place + POSE_SURROUNDINGS_M)
        inputs = PoseInputs(panorama.path, pose, carried, is_used, SceneView(run, (), tuple(around)))
        memory = pose_memory(panorama.path) if is_used else LIBRARY_BYTES
        units.append(Unit(i, panorama.path.name, inputs, memory))
    return units


def ground_height_preferred_flags(block: Block) -> list[bool]:
    """Return for each panorama whether height over ground is trusted more than the roofs.

    That holds without a stated height, and near a roof whose height is a guess.
    """
    guessed = [building.footprint for building in block.buildings if building.height_source not in ("height", "model")]
    near = shapely.STRtree(guessed)
    poses = [panorama.pose for panorama in block.panoramas]
    places = shapely.points(np.array([(pose.x, pose.y) for pose in poses]).reshape(-1, 2))
    beside = set(near.query(places, predicate="dwithin", distance=OUTLINES.max_outline_distance_m)[0].tolist())
    return [pose.z is None or i in beside for i, pose in enumerate(poses)]


def pose_memory(path: Path) -> int:
    """Return the bytes that refining a pose takes at most."""
    return LIBRARY_BYTES + peak_decoding_bytes([path]) + bounded_pixel_count([path]) * POSE_PIXEL


POSES = Stage(
    "poses",
    "panorama",
    outline=lambda block, plan: [UnitOutline(panorama.path.name) for panorama in block.panoramas],
    inputs=list_pose_units,
    compute=compute_pose,
    write=record_fields,
)
