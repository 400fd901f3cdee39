"""Forecast of streets and viewpoints that are done again."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from facade_core.atlas.journal import read_journal
from facade_core.core.arrays import IntArray
from tasks.engine.inputs import CODE, CODE_CHANGED, SETTINGS_CHANGED, VIEW_CHANGED, differing_inputs
from tasks.engine.pending_reasons import NEW, NOT_DONE
from tasks.engine.stage import ForecastInputs, StageForecast
from tasks.stages.shared.base_layer import BASE_LAYER_STAGES
from tasks.stages.streets.keys import street_keys
from tasks.stages.streets.panoramas import is_panorama_in_report

# Charts that a street reads are written again.
READS_AGAIN = "surfaces that they show are pending"
# Streets of earlier waves, or settings of theirs, changed.
STREETS_CHANGED = "texels of other streets changed"
# Of inputs that decide before others do.
_REASONS = {"settings": SETTINGS_CHANGED, CODE: CODE_CHANGED}


def forecast_pending_streets(inputs: ForecastInputs, own: Mapping[int, str]) -> StageForecast:
    """Find the streets that are pending, and note later ones that may follow."""
    run, plan, group, rewritten = inputs.run, inputs.plan, inputs.group, inputs.rewritten
    records = read_journal(group, "streets")
    blends = run.texture.translator == "neural"  # else texels of a material field: independent of viewpoints
    journals = {stage: read_journal(group, stage) for stage in (*BASE_LAYER_STAGES, "viewpoints")}
    pending: dict[int, str] = {}
    following: set[int] = set()
    # charts in sight of earlier streets that are pending or follow a pending street
    earlier, wave = np.zeros(len(plan.ids), bool), -1
    of_wave: list[IntArray] = []
    for street in sorted(np.unique(plan.street_charts[:, 0]).tolist(), key=lambda s: (int(plan.wave[s]), s)):
        if plan.wave[street] != wave:
            earlier[np.concatenate([np.zeros(0, np.int64), *of_wave])] = True
            of_wave, wave = [], int(plan.wave[street])
        charts = plan.charts_of_street(street)
        key = street_keys(run, plan, group, street, journals).street
        record = records[street]
        if record is None:
            pending[street] = NEW
        elif "views" in (changed := differing_inputs(record["key"], key)):
            pending[street] = VIEW_CHANGED
        elif part := next((part for part in _REASONS if part in changed), None):
            pending[street] = _REASONS[part]
        elif blends and np.isin(charts, rewritten).any():
            pending[street] = READS_AGAIN
        elif changed:
            pending[street] = STREETS_CHANGED
        elif record["status"] != "done":
            pending[street] = NOT_DONE
        elif blends and (plan.writable[charts] & earlier[charts]).any():
            following.add(street)
        if street in pending or street in following:
            of_wave.append(charts)
    note = None
    if following:
        noun = "street" if len(following) == 1 else "streets"
        note = f"{len(following)} more {noun} if texels that they share change"
    return StageForecast(pending, sum(map(len, inputs.outline.waves)), note)


def forecast_pending_viewpoints(inputs: ForecastInputs, own: Mapping[int, str]) -> StageForecast | None:
    """Find the viewpoints whose stored panoramas show rewritten base-layer charts, outside pending streets.

    Returns None for the neural translator: its viewpoints are counted with their streets.
    """
    if inputs.run.texture.translator == "neural":
        return None
    plan, streets = inputs.plan, inputs.pending["streets"]
    shown = np.unique(plan.select_view_rows(np.array(inputs.rewritten, np.int64))[:, 0])
    pending = {
        int(v): READS_AGAIN
        for v in shown
        if plan.viewpoints[v].street not in streets and is_panorama_in_report(plan, plan.viewpoints[v])
    }
    return StageForecast(pending, sum(inputs.outline.viewpoints))
