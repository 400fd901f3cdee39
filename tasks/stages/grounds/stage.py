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
from tasks.engine.stage import ReingestContext, Stage, match_units_by_name
from tasks.engine.stage_code import stage_code_digest
from tasks.engine.store.missing_chunks import find_units_without_base_layer
from tasks.engine.unit import Unit
from tasks.engine.unit_key import join_key_parts
from tasks.stages.bundles.nearby_panoramas import index_usable_panoramas
from tasks.stages.grounds.worker import process_ground
from tasks.stages.poses.record import PoseRecord
from tasks.stages.shared.camera_forecast import forecast_units_after_poses
from tasks.stages.shared.key_parts import panorama_key_parts
from tasks.stages.shared.memory import (
    CAMERA_PIXEL,
    GROUND_TEXEL,
    LIBRARY_BYTES,
    VIEW_TEXEL,
    bounded_pixel_count,
    detector_memory,
)
from tasks.stages.shared.surface_panorama import SurfacePanorama

# A panorama was taken so high over the ground, metres, or the block's ground is not the one it shows: a bridge, a quay.
LEAST_HEIGHT_M, MOST_HEIGHT_M = 1.2, 4.5
# Panoramas in memory at once: the one that is viewed, the next that is read, and the reader's last.
OPEN_PICTURES = 3


def list_ground_units(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit]:
    """List the units of stage `grounds`: pieces of ground near panoramas."""
    charts = plan.ground_near_cameras()
    if not len(charts):
        return []
    cameras = index_usable_panoramas(block, plan, group, _is_over_ground)
    texels = plan.texel_counts()
    units = []
    for index, (chart, name) in enumerate(zip(charts.tolist(), ground_piece_names(plan), strict=True)):
        taken = cameras.near(plan.scene.charts, [chart], GROUND_REACH_M)
        key = ground_key(run, plan, chart, taken)
        memory = ground_memory(int(texels[chart]), [one.path for one in taken])
        units.append(Unit(index, name, (key,), (chart, taken), memory, (chart,)))
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


def _match_previous(change: ReingestContext) -> dict[int, int]:
    """Match pieces that stay in place, without pieces that moved or that no panorama shows any more."""
    names, charts = ground_piece_names(change.after), change.after.ground_near_cameras().tolist()
    same = match_units_by_name(change.records["grounds"], names)
    again = {new: old for new, old in same.items() if charts[new] in change.stays}
    shown = set(names)
    of_chart = {_name(number): chart for chart, number in enumerate(change.after.ids.tolist())}
    for record in change.records["grounds"]:
        if record and record["unit"] not in shown and record["unit"] in of_chart:
            change.stays.pop(of_chart[record["unit"]], None)
    return again


def ground_key(run: Run, plan: Plan, chart: int, taken: Sequence[SurfacePanorama]) -> str:
    """Return the key of a piece of ground and the panoramas near it."""
    return join_key_parts(
        stage_code_digest("grounds"),
        settings=run.texture.texels_per_metre,
        geometry=f"{plan.ids[chart]:016x}",
        **panorama_key_parts(plan, {one: [chart] for one in taken}),
    )


def ground_memory(texels: int, pictures: Sequence[Path]) -> int:
    """Return the memory of a piece of ground with some texels; few of its panoramas are open at a time."""
    kept = sum(sorted(bounded_pixel_count([path]) for path in pictures)[-OPEN_PICTURES:])
    return (
        LIBRARY_BYTES + detector_memory() + texels * (GROUND_TEXEL + len(pictures) * VIEW_TEXEL) + kept * CAMERA_PIXEL
    )


GROUNDS = Stage(
    "grounds",
    "photographed surface",
    count=lambda block, plan: len(plan.ground_near_cameras()),
    match_previous=_match_previous,
    units=list_ground_units,
    function=process_ground,
    reads=("poses", "bundles"),
    writes_base_layer=True,
    forecast=partial(forecast_units_after_poses, "grounds"),
    unit_charts=lambda plan: plan.ground_near_cameras()[:, None].tolist(),
    unit_names=ground_piece_names,
    find_lost=lambda store: find_units_without_base_layer(store.session, store.records["grounds"]),
)
