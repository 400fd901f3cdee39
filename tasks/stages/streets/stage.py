"""Stage `streets`: streets that show pictured ground, each on its own; their views are blended where surfaces are finished."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from catalogs.block.reader import Block
from facade_core.atlas.journal import latest_chart_digests, read_journal
from facade_core.core.arrays import Int64Array
from facade_core.core.zarr_types import StoreGroup
from facade_core.geometry.charts import ChartKind
from facade_core.plan.plan import Plan
from facade_core.street.continuation import CONTINUATION
from tasks.engine.inputs import INPUTS_PENDING
from tasks.engine.run import Run
from tasks.engine.stage import ForecastInputs, Stage, StageForecast, UnitOutline
from tasks.engine.unit import Unit
from tasks.stages.shared.materials import pictured_ground
from tasks.stages.shared.memory import LIBRARY_BYTES
from tasks.stages.shared.scene_view import store_charts, view_charts
from tasks.stages.streets.worker import StreetInputs, compute_street, write_street

# Bytes per texel of differences that a street holds, with its blend state, and per pixel of a panorama.
STREET_TEXEL = 64
PANORAMA_PIXEL = 160


def list_street_units(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit[StreetInputs]]:
    """List the streets; one that shows no pictured ground depends on nothing, and has nothing to do."""
    digests = latest_chart_digests(read_journal(group, "grounds"))
    learnt = pictured_ground(run, plan, group)
    area = np.prod(plan.scene.charts.size, axis=1)
    units = []
    for index, street in enumerate(plan.streets):
        ground = _ground_of_street(plan, index)
        shown = [chart for chart in ground.tolist() if f"{plan.ids[chart]:016x}" in digests]
        viewpoints = plan.street_viewpoints(index) if shown else []
        looks = [plan.view_digests[viewpoint.id] for viewpoint in viewpoints]
        scene = plan.scene
        inputs = StreetInputs(
            street=index,
            view=view_charts(run, plan, ground.tolist() if shown else (), scene.spacing, scene.visibility_range, *looks)
            if shown
            else view_charts(run, plan, ()),
            pictured=store_charts(run, plan, shown, digests),
            pictured_ground=learnt if shown else store_charts(run, plan, (), {}),
            materials=run.materials if shown else (),
            seed=run.seed if shown else 0,
        )
        memory = street_memory(float(area[ground].sum()) if shown else 0)
        units.append(Unit(index, street.id, inputs, memory))
    return units


def street_memory(area: float) -> int:
    """Return the memory of a street that sees ground of an area, square metres."""
    texels, pixels = int(area * CONTINUATION.texels_per_metre**2), CONTINUATION.panorama_width**2 // 2
    return LIBRARY_BYTES + texels * STREET_TEXEL + pixels * PANORAMA_PIXEL


def _ground_of_street(plan: Plan, street: int) -> Int64Array:
    """Return the ground charts (k,) of the core in the panoramas of a street, ascending."""
    charts = plan.charts_of_street(street)
    is_ground: Int64Array = charts[(plan.scene.charts.kind[charts] == ChartKind.GROUND) & plan.in_core[charts]]
    return is_ground


def _forecast(inputs: ForecastInputs, own: Mapping[int, str]) -> StageForecast:
    """Find the pending streets: if ground that pictures may show is written again, all that show pictured ground."""
    rewritten = np.zeros(len(inputs.plan.ids), bool)
    rewritten[list(inputs.rewritten)] = True
    if not rewritten[inputs.plan.ground_near_cameras()].any():
        return StageForecast(own)
    pictured = {unit.index: INPUTS_PENDING for unit in inputs.units["streets"] if unit.inputs.pictured.charts}
    return StageForecast(pictured | dict(own))


STREETS = Stage(
    "streets",
    "street",
    outline=lambda block, plan: [UnitOutline(street.id) for street in plan.streets],
    inputs=list_street_units,
    compute=compute_street,
    write=write_street,
    forecast=_forecast,
)
