"""Panoramas near a surface, with refined poses and a common exposure."""

from __future__ import annotations

from collections.abc import Callable

from catalogs.block.reader import Block
from facade_core.core.types import Pose
from facade_core.core.zarr_types import StoreGroup
from facade_core.imagery.cameras.exposure import estimate_common_exposure
from facade_core.plan.plan import Plan
from tasks.stages.bundles.refined_poses import pose_from_record, read_bundled_pose_records
from tasks.stages.poses.record import PoseRecord
from tasks.stages.shared.panorama_index import UsablePanoramaIndex
from tasks.stages.shared.surface_panorama import SurfacePanorama


def index_usable_panoramas(
    block: Block, plan: Plan, group: StoreGroup, usable: Callable[[Pose, PoseRecord | None], bool]
) -> UsablePanoramaIndex:
    """Index the panoramas with a usable record, with refined poses and exposure factors."""
    records = read_bundled_pose_records(group)
    squares = [ground_squares(record) for record in records]
    gains = estimate_common_exposure(squares).factors
    taken = tuple(
        SurfacePanorama(panorama.path, pose_from_record(pose, record), tuple(gain), own)
        for panorama, pose, record, gain, own in zip(
            block.panoramas, plan.poses, records, gains.tolist(), squares, strict=True
        )
        if usable(pose, record) and not (record is not None and record.get("is_unused"))
    )
    return UsablePanoramaIndex(taken)


def ground_squares(record: PoseRecord | None) -> tuple[tuple[int, ...], ...]:
    """Return the squares of ground that a panorama shows, by its record."""
    return tuple(tuple(square) for square in record.get("squares", ())) if record else ()
