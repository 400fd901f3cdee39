"""Stage `surfaces`: final colour of the charts of each building and piece of ground, after all streets."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from catalogs.block.reader import Block
from facade_core.atlas.journal import latest_chart_digests, read_journal
from facade_core.atlas.surroundings import coplanar_pieces
from facade_core.core.arrays import IntArray
from facade_core.core.grouping import RowsByValue
from facade_core.core.zarr_types import StoreGroup
from facade_core.geometry.charts import ChartKind
from facade_core.plan.plan import Plan
from facade_core.street.lighting.ambient import AMBIENT_REACH_M
from facade_core.street.lighting.settings import SUNLIGHT
from facade_core.street.surfaces import LEVELLING_MARGIN_M
from tasks.engine.inputs import INPUTS_PENDING
from tasks.engine.run import Run
from tasks.engine.stage import ForecastInputs, Pending, Stage, UnitOutline
from tasks.engine.unit import Unit
from tasks.stages.facades.record import FacadeRecord
from tasks.stages.shared.materials import pictured_ground
from tasks.stages.shared.memory import FINISHED_TEXEL, LIBRARY_BYTES
from tasks.stages.shared.scene_view import SceneView, StoredCharts, store_charts, view_charts
from tasks.stages.shared.street_views import StoredView, list_stored_views
from tasks.stages.shared.view_inputs import bounding_box
from tasks.stages.surfaces.worker import MAX_CACHED_VIEWS, SurfaceInputs, compute_surface, write_surface

# Bytes per texel that is painted and levelled, with its surroundings (measured: 150).
SURFACE_TEXEL = 155
# Bytes per texel of the largest chart on which pictures are continued by example.
CONTINUED_TEXEL = 300
# Bytes that the sources of a continuation take, once for a piece (measured: 187 MB of 640,000 texels, 106 of 260,000).
CONTINUATION_BYTES = 50_000_000

# Bytes of a view of a street.
VIEW_BYTES = 1_100_000
# The stages that write the base layer of the atlas, in the order in which they write.
BASE_LAYER_STAGES = ("textures", "grounds", "walls", "facades")
# Of a chart that is context: no building has this row, nor has the ground.
CONTEXT_CHART = -2


def buildings_and_ground_pieces(plan: Plan) -> list[tuple[str, list[int]]]:
    """List name and charts of the block's own buildings, then of its pieces of ground."""
    owner = RowsByValue(np.where(plan.in_core, plan.scene.charts.building, CONTEXT_CHART))
    buildings = [(name, owner.rows_with(building).tolist()) for building, name in enumerate(plan.scene.names)]
    ground = [(f"ground-{int(plan.ids[chart]):016x}", [chart]) for chart in owner.rows_with(-1).tolist()]
    return [(name, charts) for name, charts in [*buildings, *ground] if charts]


def list_surface_units(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit[SurfaceInputs]]:
    """List the units of stage `surfaces`, keyed by facades, textures and streets."""
    seeds = latest_chart_digests([record for stage in BASE_LAYER_STAGES for record in read_journal(group, stage)])
    facades = read_journal(group, "facades", FacadeRecord)
    labels = {chart: one.get("label_digest") for one in facades if one for chart in one.get("digests", ())}
    walls = latest_chart_digests(read_journal(group, "walls"))
    views = list_stored_views(plan, group)
    texels = plan.texel_counts()
    is_ground = plan.scene.charts.kind == ChartKind.GROUND
    pictured = pictured_ground(run, plan, group)
    units = []
    for index, (name, charts) in enumerate(buildings_and_ground_pieces(plan)):
        inputs = surface_inputs(run, plan, charts, _charts_beside(plan, charts), seeds, views, pictured, walls, labels)
        has_seeds = bool(inputs.seeds.charts_with_texels)
        continued = any(inputs.pictured) or (has_seeds and bool(is_ground[charts[0]]))
        memory = surface_memory(texels[charts], continued=continued, views=len(inputs.views))
        units.append(Unit(index, name, inputs, memory, tuple(charts)))
    return units


def _charts_beside(plan: Plan, charts: Sequence[int]) -> list[int]:
    """Return the other charts to which some charts are levelled."""
    pieces = (coplanar_pieces(plan.scene.charts, chart, LEVELLING_MARGIN_M).tolist() for chart in charts)
    return sorted({one for of_chart in pieces for one in of_chart} - set(charts))


def surface_inputs(
    run: Run,
    plan: Plan,
    charts: Sequence[int],
    beside: Sequence[int],
    seeds: Mapping[str, str],
    views: Mapping[int, StoredView],
    pictured: StoredCharts,
    walls: Collection[str] = (),
    labels: Mapping[str, str | None] = MappingProxyType({}),
) -> SurfaceInputs:
    """Return the inputs of the charts of a unit.

    Parameters
    ----------
    charts : its charts.
    beside : neighbouring charts to which it is levelled.
    seeds : digests of the base layer of charts, by id.
    views : what viewpoints of streets decided, by viewpoint.
    pictured : ground that panoramas show.
    walls : ids of the charts that show camera pictures.
    labels : digests of the labels of charts with a facade, by id.
    """
    low, high = bounding_box(plan, charts)
    texture, reads = run.texture, [*charts, *beside]
    reach = AMBIENT_REACH_M if texture.sun is None else max(AMBIENT_REACH_M, SUNLIGHT.max_shadow_reach_m)
    is_ground = bool((plan.scene.charts.kind[list(charts)] == ChartKind.GROUND).any())
    seen = plan.select_view_rows(np.array(charts))[:, 0].tolist() if is_ground else ()
    names = [f"{plan.ids[chart]:016x}" for chart in reads]
    return SurfaceInputs(
        view=view_charts(run, plan, charts, *sorted(names[len(charts) :])),
        ground=SceneView(run, (), tuple(plan.ground_digests(charts))),
        around=SceneView(run, (), tuple(plan.scene_objects.digests_in_box(low - reach, high + reach))),
        seeds=store_charts(run, plan, reads, seeds, [labels.get(name) for name in names[: len(charts)]]),
        pictured=tuple(name in walls for name in names),
        pictured_ground=pictured if is_ground else store_charts(run, plan, (), {}),
        views=tuple(sorted((views[viewpoint] for viewpoint in set(seen) & views.keys()), key=lambda one: one.place)),
        aerial=run.aerial if is_ground else None,
        roof_material=run.roof_material,
        materials=run.materials,
        light=texture.light,
        sun=texture.sun if texture.light else None,
        levelling=texture.levelling,
        seed=run.seed,
    )


def surface_memory(texels: IntArray, *, continued: bool = False, views: int = 0) -> int:
    """Return the memory of a building or piece of ground: all charts are kept, one at a time is levelled.

    Parameters
    ----------
    texels : (k,) texels of its charts.
    continued : whether pictures are continued by example.
    views : views of streets that are blended.
    """
    example = CONTINUATION_BYTES + int(texels.max()) * CONTINUED_TEXEL if continued else 0
    held = (views + MAX_CACHED_VIEWS) * VIEW_BYTES if views else 0
    return LIBRARY_BYTES + int(texels.sum()) * FINISHED_TEXEL + int(texels.max()) * SURFACE_TEXEL + example + held


def _forecast(inputs: ForecastInputs, own: Pending) -> Pending:
    """Find the pending surfaces, with those of charts that facades, textures or streets write again."""
    plan = inputs.plan
    again = np.zeros(len(plan.ids), bool)
    again[list(inputs.rewritten)] = True
    for street in inputs.pending["streets"]:
        charts = inputs.units["streets"][street].inputs.view.charts
        again[list(charts)] = True
    if again[plan.ground_near_cameras()].any():  # other ground looks as panoramas show these pieces
        again |= plan.scene.charts.kind == ChartKind.GROUND
    following = {unit.index: INPUTS_PENDING for unit in inputs.units["surfaces"] if again[list(unit.charts)].any()}
    return following | dict(own)


SURFACES = Stage(
    "surfaces",
    "surface",
    outline=lambda block, plan: [
        UnitOutline(name, tuple(charts)) for name, charts in buildings_and_ground_pieces(plan)
    ],
    inputs=list_surface_units,
    compute=compute_surface,
    write=write_surface,
    forecast=_forecast,
)
