"""Stage `walls`: write plain walls and roofs that panoramas show to the base layer, a building at a time."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from catalogs.block.reader import Block
from facade_core.atlas.journal import Record
from facade_core.core.arrays import IntArray
from facade_core.core.types import Pose
from facade_core.core.zarr_types import StoreGroup
from facade_core.imagery.panorama_camera import WALL_REACH_M
from facade_core.plan.plan import Plan
from tasks.engine.run import Run
from tasks.engine.stage import ReingestContext, Stage
from tasks.engine.stage_code import stage_code_digest
from tasks.engine.store.missing_chunks import find_units_without_base_layer
from tasks.engine.unit import Unit
from tasks.engine.unit_key import join_key_parts
from tasks.stages.bundles.nearby_panoramas import index_usable_panoramas
from tasks.stages.shared.camera_forecast import forecast_units_after_poses
from tasks.stages.shared.key_parts import hex_chart_ids, panorama_key_parts
from tasks.stages.shared.memory import (
    CAMERA_PIXEL,
    FINISHED_TEXEL,
    GROUND_TEXEL,
    LIBRARY_BYTES,
    VIEW_TEXEL,
    bounded_pixel_count,
    detector_memory,
)
from tasks.stages.shared.surface_panorama import SurfacePanorama
from tasks.stages.walls.worker import process_walls


def list_wall_units(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit]:
    """List the units of stage `walls`: buildings with plain walls or roofs near panoramas.

    Buildings with the same panoramas follow each other, whatever their order in the source: their occluders are found once.
    """
    near = plan.walls_near_cameras()
    if not near:
        return []
    cameras = index_usable_panoramas(block, plan, group, _is_placed)
    texels = plan.texel_counts()
    units = []
    for index, (building, charts) in enumerate(near.items()):
        taken = cameras.select_by_chart(plan.scene.charts, charts, WALL_REACH_M)
        key = wall_key(run, plan, charts, taken)
        memory = wall_memory(texels[charts], [[one.path for one in of_chart] for of_chart in taken])
        arguments = (tuple(charts), tuple(taken))
        units.append(Unit(index, plan.scene.names[building], (key,), arguments, memory, tuple(charts)))
    return sorted(units, key=lambda unit: sorted({str(one.path) for of_chart in unit.arguments[1] for one in of_chart}))


def wall_building_names(plan: Plan) -> list[str]:
    """Return the names of the buildings with walls or roofs that panoramas may show."""
    return [plan.scene.names[building] for building in plan.walls_near_cameras()]


def _is_placed(_pose: Pose, record: Record | None) -> bool:
    return record is not None and record["status"] == "done"


def _match_previous(change: ReingestContext) -> dict[int, int]:
    """Match buildings whose charts all stay; the other charts of either stay no longer."""

    def units(plan: Plan) -> dict[str, tuple[int, list[int]]]:
        near = enumerate(plan.walls_near_cameras().items())
        return {plan.scene.names[building]: (unit, charts) for unit, (building, charts) in near}

    before, again = units(change.before), {}
    gone = {chart for _, charts in before.values() for chart in charts}
    for name, (unit, charts) in units(change.after).items():
        if name in before and [change.stays.get(chart) for chart in charts] == before[name][1]:
            again[unit] = before[name][0]
            gone -= set(before[name][1])
    for chart, old in list(change.stays.items()):
        if old in gone:
            del change.stays[chart]
    return again


def wall_key(run: Run, plan: Plan, charts: Sequence[int], taken: Sequence[Sequence[SurfacePanorama]]) -> str:
    """Return the key of the walls and roofs of a building, and the panoramas of each."""
    charts_of: dict[SurfacePanorama, list[int]] = {}
    for chart, of_chart in zip(charts, taken, strict=True):
        for one in of_chart:
            charts_of.setdefault(one, []).append(chart)
    return join_key_parts(
        stage_code_digest("walls"),
        settings=run.texture.texels_per_metre,
        geometry=hex_chart_ids(plan, charts),
        **panorama_key_parts(plan, dict(sorted(charts_of.items(), key=lambda item: item[0].path))),
    )


def wall_memory(texels: IntArray, pictures: Sequence[Sequence[Path]]) -> int:
    """Return the bytes that writing a building's walls and roofs takes at most.

    Parameters
    ----------
    texels : (k,) texels of its charts.
    pictures : panoramas of each chart; one chart at a time is processed, and all results are kept.
    """
    pixels = {path: bounded_pixel_count([path]) for path in {path for of_chart in pictures for path in of_chart}}
    taken = (
        count * (GROUND_TEXEL + len(of_chart) * VIEW_TEXEL) + sum(pixels[path] for path in of_chart) * CAMERA_PIXEL
        for count, of_chart in zip(texels.tolist(), pictures, strict=True)
    )
    largest: int = max(taken)
    return LIBRARY_BYTES + detector_memory() + int(texels.sum()) * FINISHED_TEXEL + largest


WALLS = Stage(
    "walls",
    "photographed building",
    count=lambda block, plan: len(plan.walls_near_cameras()),
    match_previous=_match_previous,
    units=list_wall_units,
    function=process_walls,
    reads=("poses", "bundles"),
    writes_base_layer=True,
    forecast=partial(forecast_units_after_poses, "walls"),
    unit_charts=lambda plan: list(plan.walls_near_cameras().values()),
    unit_names=wall_building_names,
    find_lost=lambda store: find_units_without_base_layer(store.session, store.records["walls"]),
)
