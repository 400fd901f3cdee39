"""Carry-over from the last ingest: places in the atlas and records of units that still exist.

The keys of units decide whether their data are valid; this module only moves them to their new places.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import icechunk
import numpy as np

from catalogs.block.reader import Block
from facade_core.atlas.arrays import STAGE_ARRAYS, STORE_FORMAT, clear_rasters, resize_arrays
from facade_core.atlas.journal import Record, clear_record, journal_path
from facade_core.atlas.store import (
    BRANCH,
    commit,
    open_repository,
    open_root,
    open_root_of_any_format,
    read_format,
)
from facade_core.atlas.stored_files import FOLDERS, delete_stored_files_except
from facade_core.atlas.table_schema import TABLES
from facade_core.core.arrays import BoolArray
from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.errors import StoreError
from facade_core.core.zarr_types import StoreGroup
from facade_core.geometry.chart_packing import PreviousChartPlacements
from facade_core.plan.plan import Plan
from facade_core.plan.plan_tables import placement_from_table, read_plan, read_table
from tasks.engine.run import Run
from tasks.engine.stage import (
    Records,
    UnitOutline,
    all_stages,
    match_names,
    match_units_by_name,
    read_journals,
    stored_files,
)

# Reason of a fresh ingest over a store that was made for the same settings.
UNREADABLE = "what the store holds cannot be read"


@dataclass(frozen=True)
class LastIngest:
    """The last ingest: its store as it was, and its plan."""

    group: StoreGroup
    plan: Plan

    @property
    def places(self) -> PreviousChartPlacements:
        """Return the chart ids and atlas places of the last ingest."""
        return PreviousChartPlacements(self.plan.ids, self.plan.scene.placement)


def store_compatibility_settings(run: Run) -> dict[str, object]:
    """Return the settings in which stores must agree for units to be carried over."""
    return {
        "pages": [AtlasSpec.page, AtlasSpec.chunk, AtlasSpec.gutter],
        "crs": run.crs,
        "texels_per_metre": run.texture.texels_per_metre,
    }


def fresh_ingest_reason(run: Run, group: StoreGroup) -> str | None:
    """Return why nothing of a store can be taken over, in words; None for an empty store."""
    if "key" not in group.attrs:
        return None
    held = group.attrs.get("made_for")
    if (
        not isinstance(held, dict)
        or read_format(group) != STORE_FORMAT
        or held.get("pages") != store_compatibility_settings(run)["pages"]
    ):
        return "another version of Streetloom made the store"
    changed = []
    if held["texels_per_metre"] != run.texture.texels_per_metre:
        changed.append(
            f"texture.texels_per_metre was {held['texels_per_metre']:g} and is {run.texture.texels_per_metre:g}"
        )
    if held["crs"] != run.crs:
        changed.append(f"the block's frame was {held['crs']} and is {run.crs}")
    return " and ".join(changed) or UNREADABLE


def read_last_ingest(run: Run, repository: icechunk.Repository) -> LastIngest | None:
    """Read the contents of a store with this format, frame and density; None otherwise.

    Other code may have made it: the keys of units tell which of them are valid.
    """
    session = repository.readonly_session(BRANCH)
    try:
        group = open_root(session)
        held = group.attrs["made_for"]
        if any(held.get(name) != wanted for name, wanted in store_compatibility_settings(run).items()):
            return None
        return LastIngest(group, read_plan(session))
    except (KeyError, FileNotFoundError, StoreError):
        return None


def read_last_places(run: Run, repository: icechunk.Repository) -> PreviousChartPlacements | None:
    """Read the charts and their places of the last ingest, of which other tables are lost; None as `read_last_ingest`."""
    session = repository.readonly_session(BRANCH)
    group = open_root_of_any_format(session)
    if fresh_ingest_reason(run, group) != UNREADABLE or "charts" not in group:
        return None
    charts = read_table(session, "charts")
    return PreviousChartPlacements(charts["id"], placement_from_table(charts))


def adapt_store_to_plan(root: StoreGroup, last: LastIngest, run: Run, block: Block, plan: Plan) -> None:
    """Carry the arrays and records of the last ingest over to a new plan, in place.

    Charts that are gone, moved or written by other stages are cleared. Records move to the new indices of their units.
    """
    before = read_journals(last.group)
    matches, stays = match_units(block, last.plan, plan, before)
    spec, placement = last.plan.scene.spec, last.plan.scene.placement
    cleared = np.flatnonzero(~np.isin(np.arange(len(last.plan.ids)), list(stays.values())))
    clear_rasters(root, spec, placement, cleared.tolist())
    resize_arrays(root, plan.scene.spec, units=unit_counts(block, plan))
    kept: set[str] = set()
    for stage in all_stages():
        again, names = matches[stage.stage], [outline.name for outline in stage.outline(block, plan)]
        held = before[stage.stage]  # empty in a store from before the stage was there
        records = [held[again[i]] if again.get(i, len(held)) < len(held) else None for i in range(len(names))]
        records = _mark_stale(records, held, names)
        written = list(map(_record_text, held))
        for index, text in enumerate(map(_record_text, records)):
            if index >= len(written) or written[index] != text:
                root[journal_path(stage.stage)][index] = text
        kept.update(path for record in records for path in stored_files(record))
    delete_stored_files_except(root, kept)


def match_units(
    block: Block, old: Plan, new: Plan, records: Mapping[str, Records]
) -> tuple[dict[str, dict[int, int]], dict[int, int]]:
    """Match units of the last ingest by name: those that write charts if all of them keep their place and their writers.

    Returns
    -------
    matches : unit, new -> old, by stage.
    stays : charts whose texels are kept, new -> old: not those of the base layer that another unit writes now.
    """
    stays = _unchanged_charts(old, new)
    matches: dict[str, dict[int, int]] = {}
    for stage in all_stages():
        after = stage.outline(block, new)
        if stage.stage not in STAGE_ARRAYS:
            matches[stage.stage] = match_units_by_name(records[stage.stage], [one.name for one in after])
            continue
        before = stage.outline(block, old)
        again = {
            here: there
            for here, there in match_names([one.name for one in before], [one.name for one in after]).items()
            if [stays.get(chart) for chart in after[here].charts] == list(before[there].charts)
        }
        matches[stage.stage] = again
        if stage.writes_base_layer:
            gone = _charts_without(before, again.values())
            fresh = _charts_without(after, again)
            stays = {here: there for here, there in stays.items() if here not in fresh and there not in gone}
    return matches, stays


def _charts_without(outlines: Sequence[UnitOutline], units: Collection[int]) -> set[int]:
    """Return the charts of the units that are not among some."""
    others = set(range(len(outlines))).difference(units)
    return {chart for unit in others for chart in outlines[unit].charts}


def unit_counts(block: Block, plan: Plan) -> dict[str, int]:
    """Return the number of units of each stage of a block."""
    return {stage.stage: len(stage.outline(block, plan)) for stage in all_stages()}


def has_all_stages(group: StoreGroup) -> bool:
    """Return whether a store has the plan, a journal for every stage and every folder of files.

    Older stores may lack some, and damaged ones tables of the plan.
    """
    return all(path in group for path in (*TABLES, *FOLDERS, *(journal_path(stage.stage) for stage in all_stages())))


def delete_unit_results(run: Run, plan: Plan, stage: str, units: Mapping[int, Sequence[int]]) -> None:
    """Delete the records of pending units, and clear the charts that they wrote.

    Parameters
    ----------
    units : charts by unit index.
    """
    if not units:
        return
    session = open_repository(run.store).writable_session(BRANCH)
    group = open_root(session)
    for index, charts in units.items():
        clear_record(group, stage, index)
        if charts:
            clear_rasters(group, plan.scene.spec, plan.scene.placement, charts, stage)
    commit(session, f"{len(units)} {stage} are due again")


def _unchanged_charts(old: Plan, new: Plan) -> dict[int, int]:
    """Return the charts that keep their place and their writers, new -> old."""
    at = {int(number): chart for chart, number in enumerate(old.ids.tolist())}
    roles = [_chart_roles(plan) for plan in (old, new)]
    there, here = ((p.scene.placement.page, p.scene.placement.x, p.scene.placement.y) for p in (old, new))
    return {
        chart: o
        for chart, number in enumerate(new.ids.tolist())
        if (o := at.get(number)) is not None
        and all(a[o] == b[chart] for a, b in zip(there, here, strict=True))
        and (roles[0][o] == roles[1][chart]).all()
    }


def _chart_roles(plan: Plan) -> BoolArray:
    """Return per chart whether it is a facade, and whether it has a texture of its own."""
    roles = np.zeros((len(plan.ids), 2), bool)
    roles[plan.facades.chart, 0], roles[:, 1] = True, plan.textured
    return roles


def _record_text(record: Record | None) -> str:
    return json.dumps(record, sort_keys=True, allow_nan=False) if record else ""


def _mark_stale(records: Records, before: Records, names: Sequence[str]) -> Records:
    """Return records with those of units that are known by name, and write other charts now, as stale: they are pending."""
    held = {record["unit"]: record for record in before if record}
    return [
        _stale_record(held[name]) if record is None and name in held else record
        for record, name in zip(records, names, strict=True)
    ]


def _stale_record(record: Record) -> Record:
    since, reason = record.get("started", 0.0), "its geometry changed"
    return Record(unit=record["unit"], key=record["key"], status="stale", reason=reason, started=since)
