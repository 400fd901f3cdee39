"""Stage `poses`: refine the poses of panoramas before facades are taken from them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely

from catalogs.block.reader import Block
from catalogs.file_digest import file_digest
from facade_core.core.zarr_types import StoreGroup
from facade_core.imagery.poses.settings import OUTLINES
from facade_core.plan.plan import Plan
from tasks.engine.run import Run
from tasks.engine.stage import ReingestContext, Stage, match_units_by_key_or_name
from tasks.engine.stage_code import stage_code_digest
from tasks.engine.unit import Unit
from tasks.engine.unit_key import join_key_parts
from tasks.stages.poses.worker import process_pose
from tasks.stages.shared.key_parts import POSE_SURROUNDINGS_M, pose_key_parts
from tasks.stages.shared.memory import LIBRARY_BYTES, bounded_pixel_count, peak_decoding_bytes
from tasks.stages.shared.picture_choice import choose_pictures

# Bytes per pixel of a panorama whose pose is refined: the picture, and edges of it at a smaller size.
POSE_PIXEL = 24


def list_pose_units(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit]:
    """List the units of stage `poses`: one for each panorama, one that no surface is taken from with little to do."""
    units, chosen = [], choose_pictures(plan, block)
    for i, (panorama, carried) in enumerate(zip(block.panoramas, ground_height_preferred_flags(block), strict=True)):
        is_used = i in chosen
        key = pose_key(run, plan, i, panorama.path, carried, is_used=is_used)
        memory = pose_memory(panorama.path) if is_used else LIBRARY_BYTES
        units.append(Unit(i, panorama.path.name, (key,), (panorama.path, carried, is_used), memory))
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


def _match_previous(change: ReingestContext) -> dict[int, int]:
    units = list_pose_units(change.run, change.block, change.after, change.group)
    return match_units_by_key_or_name(change.records["poses"], units)


def pose_key(run: Run, plan: Plan, panorama: int, path: Path, carried: bool, *, is_used: bool = True) -> str:
    """Return the key of a panorama's refinement: picture, pose and surrounding objects."""
    pose = plan.poses[panorama]
    place = np.array([pose.x, pose.y, pose.z])
    return join_key_parts(
        stage_code_digest("poses"),
        settings=run.texture.texels_per_metre,
        picture=[path.name, file_digest(path)],
        pose=[*pose_key_parts(pose), carried, *([] if is_used else ["unused"])],
        geometry=plan.scene_objects.digests_in_box(place - POSE_SURROUNDINGS_M, place + POSE_SURROUNDINGS_M),
    )


def pose_memory(path: Path) -> int:
    """Return the bytes that refining a pose takes at most."""
    return LIBRARY_BYTES + peak_decoding_bytes([path]) + bounded_pixel_count([path]) * POSE_PIXEL


POSES = Stage(
    "poses",
    "panorama",
    count=lambda block, plan: len(block.panoramas),
    match_previous=_match_previous,
    units=list_pose_units,
    function=process_pose,
)
