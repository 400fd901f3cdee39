"""Stage `grounds`: write ground that panoramas show to the base layer, a piece at a time."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from catalogs.block.reader import Block
from facade_core.core.types import Pose
from facade_core.core.zarr_types import StoreGroup
from facade_core.imagery.panorama_camera import GROUND_REACH_M
from facade_core.plan.plan import Plan
from tasks.engine.run import Run
from tasks.engine.stage import Stage, UnitOutline
from tasks.engine.unit import Unit
from tasks.stages.bundles.nearby_panoramas import index_usable_panoramas
from tasks.stages.grounds.worker import GroundInputs, compute_ground
from tasks.stages.poses.record import PoseRecord
from tasks.stages.shared.camera_forecast import forecast_units_after_poses
from tasks.stages.shared.memory import (
    CAMERA_PIXEL,
    GROUND_TEXEL,
    LIBRARY_BYTES,
    VIEW_TEXEL,
    bounded_pixel_count,
    detector_memory,
)
from tasks.stages.shared.panorama_cameras import write_panorama_surfaces
from tasks.stages.shared.scene_view import view_charts
from tasks.stages.shared.view_inputs import view_between

# A panorama was taken so high over the ground, metres, or the block's ground is not the one it shows: a bridge, a quay.
LEAST_HEIGHT_M, MOST_HEIGHT_M = 1.2, 4.5
# Panoramas in memory at once: the one that is viewed, the next that is read, and the reader's last.
OPEN_PICTURES = 3


def list_ground_units(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit[GroundInputs]]:
    """List the units of stage `grounds`: pieces of ground near panoramas."""
    charts = plan.ground_near_cameras()
    if not len(charts):
        return []
    cameras = index_usable_panoramas(block, plan, group, _is_over_ground)
    texels = plan.texel_counts()
    units = []
    for index, (chart, name) in enumerate(zip(charts.tolist(), ground_piece_names(plan), strict=True)):
        taken = cameras.near(plan.scene.charts, [chart], GROUND_REACH_M)
        inputs = GroundInputs(
            panoramas=tuple(taken),
            between=view_between(run, plan, {one: [chart] for one in taken}),
            view=view_charts(run, plan, [chart]),
        )
        memory = ground_memory(int(texels[chart]), [one.path for one in taken])
        units.append(Unit(index, name, inputs, memory, (chart,)))
    return units


def ground_piece_names(plan: Plan) -> list[str]:
    """Return the names of the pieces of ground that panoramas may show."""
    return [_name(number) for number in plan.ids[plan.ground_near_cameras()].tolist()]


def _name(number: int) -> str:
    return f"ground-{number:016x}"


def _is_over_ground(pose: Pose, record: PoseRecord | None) -> bool:
    if pose.is_aerial:
        return record is not None and record["status"] == "done"
    height = None if record is None or record["status"] != "done" else record.get("over_ground_m")
    return height is not None and LEAST_HEIGHT_M <= height <= MOST_HEIGHT_M


def ground_memory(texels: int, pictures: Sequence[Path]) -> int:
    """Return the memory of a piece of ground with some texels; few of its panoramas are open at a time."""
    kept = sum(sorted(bounded_pixel_count([path]) for path in pictures)[-OPEN_PICTURES:])
    return (
        LIBRARY_BYTES + detector_memory() + texels * (GROUND_TEXEL + len(pictures) * VIEW_TEXEL) + kept * CAMERA_PIXEL
    )


GROUNDS = Stage(
    "grounds",
    "photographed surface",
    outline=lambda block, plan: [
        UnitOutline(name, (chart,))
        for name, chart in zip(ground_piece_names(plan), plan.ground_near_cameras().tolist(), strict=True)
    ],
    inputs=list_ground_units,
    compute=compute_ground,
    write=write_panorama_surfaces,
    forecast=partial(forecast_units_after_poses, "grounds"),
)
