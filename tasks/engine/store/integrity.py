"""Integrity of a store: records without data, unreadable chunks.

Damage is found from records, listings and sizes before each run. Repair deletes the records of damaged units, so that they
are done again.
"""

from __future__ import annotations

from collections.abc import Sequence

import icechunk

from catalogs.published.folders import Folder
from facade_core.atlas.arrays import clear_rasters
from facade_core.atlas.integrity import (
    DAMAGE_ERRORS,
    find_broken_tags,
    find_unreadable_chunks,
    has_all_files,
    require_readable_files,
    roll_back_to_readable,
)
from facade_core.atlas.journal import clear_record
from facade_core.atlas.store import BRANCH, Repository, commit, open_repository, open_root, open_root_of_any_format
from facade_core.atlas.store_location import StoreLocation
from facade_core.atlas.table_schema import TABLES
from facade_core.core.errors import StoreFormatError
from facade_core.core.zarr_types import StoreGroup
from facade_core.plan.plan import Plan
from facade_core.plan.plan_tables import list_tables, read_plan, read_table
from tasks.engine.run import Run
from tasks.engine.stage import (
    Records,
    Stage,
    all_stages,
    read_journals,
    stored_files,
)
from tasks.engine.store.digests import find_differing_units
from tasks.engine.store.missing_chunks import find_units_with_missing_chunks
from tasks.engine.store.unreadable import charts_of_records, empty_unreadable_chunks

# File in a run's folder that requests a check of everything in its store.
SUSPECT = ".suspect"
# Units of a stage that are named in a line at most.
MAX_NAMED = 3


def find_lost_units(session: icechunk.Session) -> dict[str, list[int]]:
    """Find the units that are recorded as done and whose data are missing, by stage. No raster is read."""
    group = open_root(session)
    records = read_journals(group)
    found: dict[str, list[int]] = {}
    for stage in all_stages():
        lost = find_units_with_missing_chunks(session, stage.stage, records[stage.stage])
        lost.update(
            unit
            for unit, record in enumerate(records[stage.stage])
            if not all(path in group for path in stored_files(record))
        )
        found[stage.stage] = sorted(lost)
    return {name: units for name, units in found.items() if units}


def mark_store_suspect(out: Folder) -> None:
    """Request a complete check of the store by the next run."""
    (out / SUSPECT).touch()


def is_store_marked_suspect(out: Folder) -> bool:
    """Report whether a complete check of the store was requested."""
    return (out / SUSPECT).is_file()


def repair_store(run: Run) -> list[str]:
    """Delete the records of units whose data are lost; return lines on the losses.

    Raises
    ------
    StoreError : nothing can be read any more.
    """
    if not run.store.is_dir():
        return []
    said = []
    if back := roll_back_to_readable(run.store, _read_folders):
        said.append(
            f"{run.store}: the newest snapshot cannot be read ({back.reason}); the run goes on from that of "
            f"{back.written_at:%Y-%m-%d %H:%M:%S} UTC, and later work is pending again"
        )
    if not run.store.is_dir():  # it was never begun
        return said
    repository = open_repository(run.store)
    session = repository.writable_session(BRANCH)
    if repository.lookup_snapshot(session.snapshot_id).parent_id is None:
        return said
    try:
        group = open_root(session)
    except StoreFormatError:  # the ingest begins it anew
        return said
    if group.attrs.get("block", run.block) != run.block:
        return said
    if damaged := _remove_damaged_tables(run.store, session, group):  # the ingest makes them again
        return [*said, f"{run.store}: tables {', '.join(damaged)} cannot be read; they are made again"]
    is_suspect = is_store_marked_suspect(run.folder)
    try:
        said += _repair(run.store, repository, session, group, thorough=is_suspect)
    except DAMAGE_ERRORS:
        if is_suspect:
            raise
        session.discard_changes()
        said += _repair(run.store, repository, session, group, thorough=True)
    (run.folder / SUSPECT).unlink(missing_ok=True)
    return said


def _remove_damaged_tables(store: StoreLocation, session: icechunk.Session, group: StoreGroup) -> list[str]:
    """Remove tables of the plan that cannot be read; returns the names of missing ones."""
    if damaged := _find_damaged_tables(session):
        require_readable_files(store)
        damaged = _find_damaged_tables(session)
    for name in damaged:
        if name in group:
            del group[name]
    if damaged and all(TABLES[name].is_optional for name in damaged):
        group.attrs["plan"] = ""  # without them the rest would count as the whole plan
    if session.has_uncommitted_changes:
        commit(session, f"mend: tables {', '.join(damaged)}")
    return damaged


def _find_damaged_tables(session: icechunk.Session) -> list[str]:
    damaged = []
    for name in list_tables(session):
        try:
            read_table(session, name)
        except DAMAGE_ERRORS:
            damaged.append(name)
    return damaged


def _repair(
    store: StoreLocation,
    repository: Repository,
    session: icechunk.Session,
    group: StoreGroup,
    *,
    thorough: bool,
) -> list[str]:
    """Repair a store whose plan can be read. With `thorough` every chunk is read and compared with its record."""
    said = []
    due: dict[str, set[int]] = {}
    if thorough or not has_all_files(repository, store):
        for tag in find_broken_tags(repository, store):
            repository.delete_tag(tag)
            said.append(f"{store}: tag {tag} cannot be read and is removed")
        due = _empty_damaged_chunks(store, session, group, thorough=thorough)
    lost_units = find_lost_units(session)
    if not due and not lost_units:
        return said
    for owner in all_stages():
        due.setdefault(owner.stage, set()).update(lost_units.get(owner.stage, ()))
    if line := _delete_records(group, read_plan(session), due):
        commit(session, f"mend: {line}")
        said.append(f"{store}: {line} lost what they made; they are due again")
    return said


def _empty_damaged_chunks(
    store: StoreLocation, session: icechunk.Session, group: StoreGroup, *, thorough: bool
) -> dict[str, set[int]]:
    """Empty unreadable chunks; returns by stage the units that wrote them, and with `thorough` those whose data differ."""
    plan = read_plan(session)
    if lost := find_unreadable_chunks(session):
        require_readable_files(store)
        lost = find_unreadable_chunks(session)
    due = empty_unreadable_chunks(group, plan, lost)
    if thorough:
        for stage, units in find_differing_units(group, plan).items():
            due.setdefault(stage, set()).update(units)
    return due


def _delete_records(group: StoreGroup, plan: Plan, due: dict[str, set[int]]) -> str:
    """Delete the records of units, and of later ones that write on their base layer; returns their names."""
    records = read_journals(group)
    base = next(stage.stage for stage in all_stages() if stage.writes_base_layer)
    charts: set[int] = set()
    for stage in all_stages():
        if stage.writes_base_layer:
            lost = [records[stage.stage][unit] for unit in due.get(stage.stage, ())]
            charts |= charts_of_records(plan, lost)
    said = [
        _describe(stage, records[stage.stage], sorted(due[stage.stage]))
        for stage in all_stages()
        if due.get(stage.stage)
    ]
    for stage in all_stages():
        for unit in sorted(due.get(stage.stage, ())):
            clear_record(group, stage.stage, unit)
    clear_rasters(group, plan.scene.spec, plan.scene.placement, sorted(charts), base)
    return ", ".join(said)


def _describe(stage: Stage, records: Records, units: Sequence[int]) -> str:
    """Return a text such as "2 facades (a-1, a-2)"."""
    names = [record["unit"] if (record := records[unit]) else str(unit) for unit in units[:MAX_NAMED]]
    names += ["..."] if len(units) > MAX_NAMED else []
    noun = stage.stage.removesuffix("s") if len(units) == 1 else stage.stage
    return f"{len(units)} {noun} ({', '.join(names)})"


def _read_folders(session: icechunk.Session) -> None:
    """Read the attributes of a snapshot's folders: ingest and units restore what else it holds."""
    group = open_root_of_any_format(session)
    for name in sorted(name for name, _ in group.groups()):
        dict(group[name].attrs)
