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
from facade_core.plan.plan import Plan
from tasks.engine.run import Run
from tasks.engine.stage import Stage, UnitOutline
from tasks.engine.unit import Unit
from tasks.stages.bundles.nearby_panoramas import index_usable_panoramas
from tasks.stages.shared.camera_forecast import forecast_units_after_poses
from tasks.stages.shared.memory import (
    CAMERA_PIXEL,
    FINISHED_TEXEL,
    GROUND_TEXEL,
    LIBRARY_BYTES,
    VIEW_TEXEL,
    bounded_pixel_count,
    detector_memory,
)
from tasks.stages.shared.panorama_cameras import write_panorama_surfaces
from tasks.stages.shared.scene_view import view_charts
from tasks.stages.shared.surface_panorama import SurfacePanorama
from tasks.stages.shared.view_inputs import view_between
from tasks.stages.walls.worker import WallInputs, compute_walls


def list_wall_units(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit[WallInputs]]:
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
        taken = cameras.select_by_chart(plan.scene.charts, charts)
        inputs = WallInputs(
            panoramas=tuple(taken),
            between=view_between(run, plan, _charts_by_panorama(charts, taken)),
            view=view_charts(run, plan, charts),
        )
        memory = wall_memory(texels[charts], [[one.path for one in of_chart] for of_chart in taken])
        units.append(Unit(index, plan.scene.names[building], inputs, memory, tuple(charts)))
    return sorted(units, key=lambda unit: sorted({str(one.path) for of in unit.inputs.panoramas for one in of}))


def _is_placed(_pose: Pose, record: Record | None) -> bool:
    return record is not None and record["status"] == "done"


def _charts_by_panorama(
    charts: Sequence[int], taken: Sequence[Sequence[SurfacePanorama]]
) -> dict[SurfacePanorama, list[int]]:
    charts_of: dict[SurfacePanorama, list[int]] = {}
    for chart, of_chart in zip(charts, taken, strict=True):
        for one in of_chart:
            charts_of.setdefault(one, []).append(chart)
    return dict(sorted(charts_of.items(), key=lambda item: item[0].path))


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
    outline=lambda block, plan: [
        UnitOutline(plan.scene.names[building], tuple(charts)) for building, charts in plan.walls_near_cameras().items()
    ],
    inputs=list_wall_units,
    compute=compute_walls,
    write=write_panorama_surfaces,
    forecast=partial(forecast_units_after_poses, "walls"),
)
