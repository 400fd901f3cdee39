"""Forecast of facades that are done again."""

from __future__ import annotations

from collections.abc import Sequence

from facade_core.atlas.journal import read_journal
from facade_core.plan.plan import Plan
from tasks.engine.inputs import PANORAMAS_CHANGED, split_key
from tasks.engine.stage import ForecastInputs, Pending
from tasks.stages.bundles.stage import bundle_members
from tasks.stages.facades.imagery import EXEMPLAR_CHANGED, HOUSE_CHANGED
from tasks.stages.facades.record import FacadeRecord, names_source
from tasks.stages.shared.captures import facade_panoramas_by_capture


def forecast_pending_facades(inputs: ForecastInputs, own: Pending) -> Pending:
    """Find the facades that become pending once panoramas and exemplars are done again."""
    plan, block, exemplars = inputs.plan, inputs.block, inputs.pending["exemplars"]
    records = read_journal(inputs.group, "facades", FacadeRecord)
    poses = {*inputs.pending["poses"], *bundle_members(plan, block, sorted(inputs.pending["bundles"]))}
    sources = {unit.name for unit in inputs.units["exemplars"] if unit.index in exemplars}
    shown = [(*of.newest, *of.before) for of in facade_panoramas_by_capture(plan, block)] if poses else []
    found = dict(own)
    for facade, record in enumerate(records):
        if record is None:
            continue
        if exemplars and own.get(facade) in (None, EXEMPLAR_CHANGED):
            found.pop(facade, None)
            if any(names_source(record.get("source"), name) for name in sources):
                found[facade] = EXEMPLAR_CHANGED
        from_panoramas = poses and "panoramas" in split_key(record["key"])
        if facade not in found and from_panoramas and not poses.isdisjoint(shown[facade]):
            found[facade] = PANORAMAS_CHANGED
    return dict(sorted({**_find_housemates(plan, records, found), **found}.items()))


def _find_housemates(plan: Plan, records: Sequence[FacadeRecord | None], found: Pending) -> Pending:
    """Find the facades that depend on others of their building whose panoramas changed."""
    of_house = {"exposed_with", "coloured_by"}
    building_of = plan.facades.house.tolist()
    changed = {building_of[facade] for facade, reason in found.items() if reason == PANORAMAS_CHANGED}
    return {
        facade: HOUSE_CHANGED
        for facade, record in enumerate(records)
        if record is not None and building_of[facade] in changed and not of_house.isdisjoint(split_key(record["key"]))
    }
