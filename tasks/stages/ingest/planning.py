"""Plan of a block."""

from __future__ import annotations

from functools import partial

from catalogs.block.digest import plan_input_digest
from catalogs.block.reader import Block
from facade_core.geometry.chart_packing import PreviousChartPlacements
from facade_core.geometry.ground.terrain import build_terrain
from facade_core.plan.core_region import CoreRegion
from facade_core.plan.identity import ParallelMap, map_in_this_process
from facade_core.plan.ingest import BlockInputs, build_plan, fill_pose_heights
from facade_core.plan.plan import Plan
from facade_core.plan.planned_units import PlannedUnits, count_units
from facade_core.plan.posed_pictures import replace_panoramas
from tasks.engine.stage_code import stage_code_digest
from tasks.stages.ingest.photo_resolution import photo_resolution
from tasks.stages.shared.images import image_size
from tasks.stages.shared.materials import mark_aerial_roofs


def make_plan(
    block: Block, last: PreviousChartPlacements | None = None, each: ParallelMap = map_in_this_process
) -> Plan:
    """Make the plan of a block by its settings.

    Parameters
    ----------
    last : places of an earlier ingest: charts keep their place in the atlas.
    each : maps a function over items; it may cast rays on workers.
    """
    plan = build_plan(_plan_inputs(block), block.texture, previous=last, parallel_map=each, core=_core_region(block))
    return plan if block.aerial is None else mark_aerial_roofs(plan, block.aerial)


def count_planned_units(block: Block) -> PlannedUnits:
    """Count the units of a block's plan without the rays of viewpoints."""
    return count_units(_plan_inputs(block), block.texture, _core_region(block), partial(photo_resolution, block))


def _plan_inputs(block: Block) -> BlockInputs:
    return BlockInputs(
        block.buildings,
        block.streets,
        block.storey,
        ground=block.ground,
        elevation=block.terrain,
        neighbours=block.neighbours,
        poses=[panorama.pose for panorama in block.panoramas],
        panorama_sizes=_panorama_sizes(block),
    )


def _core_region(block: Block) -> CoreRegion | None:
    return None if block.part is None else CoreRegion(frozenset(block.part.buildings), frozenset(block.part.streets))


def plan_reuse_key(block: Block) -> str:
    """Return the digest of a plan's inputs without panoramas; if equal, the plan is reused."""
    return f"{plan_input_digest(block)} {stage_code_digest('ingest')}"


def update_plan_panoramas(block: Block, plan: Plan) -> Plan:
    """Return the last ingest's plan with the panoramas placed again."""
    poses = tuple(panorama.pose for panorama in block.panoramas)
    if any(pose.z is None for pose in poses):
        poses = fill_pose_heights(poses, build_terrain(block.buildings, block.terrain), block.texture.viewpoint_height)
    return replace_panoramas(
        plan, poses, _panorama_sizes(block), PreviousChartPlacements(plan.ids, plan.scene.placement)
    )


def _panorama_sizes(block: Block) -> list[tuple[int, int]]:
    return [image_size(panorama.path) for panorama in block.panoramas]
