"""Stage `surfaces`: final colour of the charts of each building and piece of ground, after all streets."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from catalogs.block.reader import Block
from facade_core.atlas.journal import latest_chart_digests, read_journal
from facade_core.atlas.store import open_table
from facade_core.atlas.surroundings import coplanar_pieces
from facade_core.core.arrays import IntArray
from facade_core.core.grouping import RowsByValue
from facade_core.core.zarr_types import StoreGroup
from facade_core.geometry.charts import ChartKind
from facade_core.plan.plan import Plan
from facade_core.street.surfaces import LEVELLING_MARGIN_M
from tasks.engine.pending_reasons import REASONS
from tasks.engine.run import Run
from tasks.engine.stage import ForecastInputs, IntegrityInputs, ReingestContext, Stage, StageForecast, is_done_record
from tasks.engine.store.missing_chunks import find_charts_with_missing_chunks
from tasks.engine.unit import Unit
from tasks.stages.shared.base_layer import BASE_LAYER_STAGES
from tasks.stages.shared.memory import FINISHED_TEXEL, LIBRARY_BYTES
from tasks.stages.streets.record import StreetRecord
from tasks.stages.surfaces.keys import surface_key
from tasks.stages.surfaces.worker import process_surface

# Bytes per texel that is painted and levelled, with its surroundings (measured: 150).
SURFACE_TEXEL = 155
# Bytes per texel of the largest chart on which pictures are continued by example.
CONTINUED_TEXEL = 300
# Bytes that the sources of a continuation take, once for a piece (measured: 187 MB of 640,000 texels, 106 of 260,000).
CONTINUATION_BYTES = 50_000_000

# Of a chart that is context: no building has this row, nor has the ground.
CONTEXT_CHART = -2


def buildings_and_ground_pieces(plan: Plan) -> list[tuple[str, list[int]]]:
    """List name and charts of the block's own buildings, then of its pieces of ground."""
    owner = RowsByValue(np.where(plan.in_core, plan.scene.charts.building, CONTEXT_CHART))
    buildings = [(name, owner.rows_with(building).tolist()) for building, name in enumerate(plan.scene.names)]
    ground = [(f"ground-{int(plan.ids[chart]):016x}", [chart]) for chart in owner.rows_with(-1).tolist()]
    return [(name, charts) for name, charts in [*buildings, *ground] if charts]


def list_surface_units(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit]:
    """List the units of stage `surfaces`, keyed by facades, textures and streets."""
    seeds = latest_chart_digests([record for stage in BASE_LAYER_STAGES for record in read_journal(group, stage)], [])
    walls = latest_chart_digests(read_journal(group, "walls"), [])
    streets = latest_chart_digests([], read_journal(group, "streets", StreetRecord))
    texels, ids = plan.texel_counts(), [f"{number:016x}" for number in plan.ids.tolist()]
    is_ground = plan.scene.charts.kind == ChartKind.GROUND
    units = []
    for index, (name, charts) in enumerate(buildings_and_ground_pieces(plan)):
        beside = sorted(
            {int(one) for chart in charts for one in coplanar_pieces(plan.scene.charts, chart, LEVELLING_MARGIN_M)}
            - set(charts)
        )
        reads = [*charts, *beside]
        seeded, written, pictured = (
            frozenset(c for c in reads if ids[c] in digests) for digests in (seeds, streets, walls)
        )
        continued = bool(pictured) or (bool(seeded) and bool(is_ground[charts[0]]))
        units.append(
            Unit(
                index,
                name,
                (surface_key(run, plan, charts, beside, seeds, streets),),
                (tuple(charts), seeded, written, pictured),
                surface_memory(texels[charts], continued=continued),
                tuple(charts),
            )
        )
    return units


def _match_previous(change: ReingestContext) -> dict[int, int]:
    """Match buildings and ground whose charts all stay: the charts of others are cleared."""
    before = {name: (unit, charts) for unit, (name, charts) in enumerate(buildings_and_ground_pieces(change.before))}
    return {
        unit: before[name][0]
        for unit, (name, charts) in enumerate(buildings_and_ground_pieces(change.after))
        if name in before and [change.stays.get(chart) for chart in charts] == before[name][1]
    }


def surface_memory(texels: IntArray, *, continued: bool = False) -> int:
    """Return the memory of a building or piece of ground: all charts are kept, one at a time is levelled.

    Parameters
    ----------
    texels : (k,) texels of its charts.
    continued : whether pictures are continued by example.
    """
    example = CONTINUATION_BYTES + int(texels.max()) * CONTINUED_TEXEL if continued else 0
    return LIBRARY_BYTES + int(texels.sum()) * FINISHED_TEXEL + int(texels.max()) * SURFACE_TEXEL + example


def _find_lost(store: IntegrityInputs) -> list[int]:
    """Find surfaces that are done and of whose charts a chunk is not listed: each of their texels has a source."""
    records = store.records["surfaces"]
    if not any(map(is_done_record, records)):
        return []
    ids = open_table(store.session, "charts").id.values.tolist()
    missing = find_charts_with_missing_chunks(store.session, "atlas/provenance", range(len(ids)))
    lost = {f"{ids[chart]:016x}" for chart in missing}
    return [i for i, r in enumerate(records) if r and is_done_record(r) and not lost.isdisjoint(r["digests"])]


def _forecast(inputs: ForecastInputs, own: Mapping[int, str]) -> StageForecast:
    """Find the pending surfaces, with those of charts that facades, textures or streets write again."""
    plan = inputs.plan
    again = np.zeros(len(plan.ids), bool)
    again[list(inputs.rewritten)] = True
    for street in inputs.pending["streets"]:
        charts = plan.charts_of_street(street)
        again[charts[plan.writable[charts]]] = True
    following = {
        unit.index: REASONS["seeds"] for unit in inputs.units["surfaces"] if again[list(unit.arguments[0])].any()
    }
    return StageForecast(following | dict(own))


SURFACES = Stage(
    "surfaces",
    "surface",
    count=lambda block, plan: len(buildings_and_ground_pieces(plan)),
    match_previous=_match_previous,
    units=list_surface_units,
    function=process_surface,
    reads=(*BASE_LAYER_STAGES, "streets"),
    in_every_block=True,
    unit_charts=lambda plan: [charts for _, charts in buildings_and_ground_pieces(plan)],
    unit_names=lambda plan: [name for name, _ in buildings_and_ground_pieces(plan)],
    find_lost=_find_lost,
    forecast=_forecast,
)
