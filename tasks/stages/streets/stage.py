"""Stage `streets`: streets that show pictured ground, each on its own; their views are blended where surfaces are finished."""

from __future__ import annotations

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
from tasks.engine.stage import ForecastInputs, Pending, Stage, UnitOutline
from tasks.engine.unit import Unit
from tasks.stages.shared.materials import pictured_ground
from tasks.stages.shared.memory import LIBRARY_BYTES
from tasks.stages.shared.scene_view import store_charts, view_charts
from tasks.stages.streets.worker import StreetInputs, compute_street, write_street

# Bytes per texel of differences that a street holds, with its blend state, and per pixel of a panorama.
STREET_TEXEL = 64
PANORAMA_PIXEL = 160
# Bytes per texel of pictures that a street reads, and of the largest of their charts while its means are taken.
PICTURED_TEXEL, AVERAGED_TEXEL = 4, 60
NO_TEXELS = np.zeros(0, np.int64)


def list_street_units(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit[StreetInputs]]:
    """List the streets; one that shows no pictured ground depends on nothing, and has nothing to do."""
    digests = latest_chart_digests(read_journal(group, "grounds"))
    learnt, nothing = pictured_ground(run, plan, group), store_charts(run, plan, (), {})
    scene, texels, units = plan.scene, plan.texel_counts(), []
    for index, street in enumerate(plan.streets):
        ground = _ground_of_street(plan, index)
        shown = [chart for chart in ground.tolist() if f"{plan.ids[chart]:016x}" in digests]
        inputs, memory = StreetInputs(index, view_charts(run, plan, ()), nothing, nothing, (), 0), street_memory()
        if shown:
            looks = [plan.view_digests[viewpoint.id] for viewpoint in plan.street_viewpoints(index)]
            view = view_charts(run, plan, ground.tolist(), scene.spacing, scene.visibility_range, *looks)
            pictured = store_charts(run, plan, shown, digests)
            inputs = StreetInputs(index, view, pictured, learnt, run.materials, run.seed)
            memory = street_memory(float(np.prod(scene.charts.size[ground], axis=1).sum()), texels[shown])
        units.append(Unit(index, street.id, inputs, memory))
    return units


def street_memory(area: float = 0.0, shown: Int64Array = NO_TEXELS) -> int:
    """Return the memory of a street.

    Parameters
    ----------
    area : of the ground that it sees, square metres.
    shown : (k,) texels of the charts that pictures show.
    """
    texels, pixels = int(area * CONTINUATION.texels_per_metre**2), CONTINUATION.panorama_width**2 // 2
    pictures = int(shown.sum()) * PICTURED_TEXEL + int(shown.max(initial=0)) * AVERAGED_TEXEL
    return LIBRARY_BYTES + texels * STREET_TEXEL + pixels * PANORAMA_PIXEL + pictures


def _ground_of_street(plan: Plan, street: int) -> Int64Array:
    """Return the ground charts (k,) of the core in the panoramas of a street, ascending."""
    charts = plan.charts_of_street(street)
    is_ground: Int64Array = charts[(plan.scene.charts.kind[charts] == ChartKind.GROUND) & plan.in_core[charts]]
    return is_ground


def _forecast(inputs: ForecastInputs, own: Pending) -> Pending:
    """Find the pending streets: if ground that pictures may show is written again, all that show pictured ground."""
    rewritten = np.zeros(len(inputs.plan.ids), bool)
    rewritten[list(inputs.rewritten)] = True
    if not rewritten[inputs.plan.ground_near_cameras()].any():
        return own
    pictured = {unit.index: INPUTS_PENDING for unit in inputs.units["streets"] if unit.inputs.pictured.charts}
    return pictured | dict(own)


STREETS = Stage(
    "streets",
    "street",
    outline=lambda block, plan: [UnitOutline(street.id) for street in plan.streets],
    inputs=list_street_units,
    compute=compute_street,
    write=write_street,
    forecast=_forecast,
)
