"""Choice of the pictures that a block needs, before their poses are refined."""

from __future__ import annotations

from catalogs.block.reader import Block
from facade_core.imagery.panorama_camera import GROUND_REACH_M
from facade_core.plan.plan import Plan
from tasks.stages.shared.captures import facade_panoramas_by_capture
from tasks.stages.shared.panorama_index import UsablePanoramaIndex
from tasks.stages.shared.surface_panorama import SurfacePanorama

# The latest choice: units and bundles of one ingest ask for it in turn.
_LATEST: list[tuple[Plan, Block, frozenset[int]]] = []


def choose_pictures(plan: Plan, block: Block) -> frozenset[int]:
    """Choose the panoramas that a surface would be taken from by the stated poses; the poses of others need no refinement.

    All panoramas without a lens are chosen: they show what lies around them. A facade keeps the pictures that show most of it;
    ground, walls and roofs those of `UsablePanoramaIndex`, which prefers pictures that other surfaces keep.
    """
    if all(pose.lens is None for pose in plan.poses):
        return frozenset(range(len(plan.poses)))
    for known_plan, known_block, known in _LATEST:
        if known_plan is plan and known_block is block:
            return known
    chosen = _choose(plan, block)
    _LATEST[:] = [(plan, block, chosen)]
    return chosen


def _choose(plan: Plan, block: Block) -> frozenset[int]:
    panoramas = tuple(
        SurfacePanorama(panorama.path, pose, (), ()) for panorama, pose in zip(block.panoramas, plan.poses, strict=True)
    )
    number = {one: index for index, one in enumerate(panoramas)}
    chosen = {index for one, index in number.items() if one.pose.lens is None}
    index, charts = UsablePanoramaIndex(panoramas), plan.scene.charts
    for capture in facade_panoramas_by_capture(plan, block):
        chosen.update(capture.newest, capture.before)
    for chart in plan.ground_near_cameras().tolist():
        chosen.update(number[one] for one in index.near(charts, [chart], GROUND_REACH_M, chosen))
    for walls in plan.walls_near_cameras().values():
        for taken in index.select_by_chart(charts, walls, chosen):
            chosen.update(number[one] for one in taken)
    return frozenset(chosen)
