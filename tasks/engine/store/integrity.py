"""Wounds of a store: records whose data are not there, streets done over viewpoints that are not, chunks that cannot be read.

They are told from records, listings and sizes before each run, and mended by making the units due again that carry them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import icechunk
import numpy as np

from catalogs.published.folders import Folder
from facade_core.atlas.arrays import clear_rasters
from facade_core.atlas.integrity import find_broken_tags, list_chunks, has_all_files, roll_back_to_readable, find_unreadable_chunks
from facade_core.atlas.journal import Record, clear_record, read_journal, unit_key
from facade_core.atlas.rasters import picture_digest
from facade_core.atlas.store import BRANCH, commit, open_repository, open_root, open_table, open_root_of_any_format
from facade_core.atlas.stored_files import FILE_STAGES, FOLDERS, unit_files
from facade_core.core.errors import FormatError
from facade_core.core.grouping import RowIndex
from facade_core.core.zarr_types import StoreGroup
from facade_core.plan.plan import Plan
from facade_core.plan.plan_tables import placement_of, read_plan, read_table
from tasks.engine.outcome import is_done
from tasks.engine.run import Run
from tasks.engine.store.digests import differing
from tasks.engine.store.unreadable import give_up, units_of_charts
from tasks.stages.grounds.stage import names_of_ground
from tasks.stages.order import STAGES, read_journals
from tasks.stages.streets.keys import street_keys
from tasks.stages.surfaces.stage import parts_of_block
from tasks.stages.walls.stage import names_of_walls

Records = Sequence[Record | None]
# Units by stage.
Units = Mapping[str, Iterable[int]]

# What may be lost of a store and made again, unit by unit; all else is the plan.
MADE = ("atlas", "facade_maps", "panoramas", "exemplars", "journal", *FOLDERS)
# Lies in a run's folder where everything in its store is to be read.
SUSPECT = ".suspect"
# Units of a stage that are named in a line at most.
NAMED = 3


def find_wounds(session: icechunk.Session) -> dict[str, list[int]]:
    """The units that are recorded as done and are not whole, by stage. No raster is read.

    A street whose viewpoints are being done again is among them: whether it is due anyway is for its key to say.
    """
    group = open_root(session)
    records = read_journals(group)
    viewpoints = _without_panorama(session, group, records["viewpoints"])
    found = {
        "exemplars": [
            i
            for i, record in enumerate(records["exemplars"])
            if _done(record) and not all(f"exemplars/{i}/{name}" in group for name in ("image", "labels"))
        ],
        "grounds": _without_seeds(session, records["grounds"]),
        "walls": _without_seeds(session, records["walls"]),
        "facades": _without_rasters(session, records["facades"]),
        "viewpoints": viewpoints,
        "streets": _over_other_viewpoints(session, records["streets"], records["viewpoints"], viewpoints),
        "surfaces": _without_texels(session, records["surfaces"]),
    }
    for stage in FILE_STAGES:
        lost = set(found.get(stage, ()))
        found[stage] = [
            unit
            for unit, record in enumerate(records[stage])
            if unit in lost or not all(path in group for path in unit_files(stage, unit, record))
        ]
    return {stage: units for stage, units in found.items() if units}


def suspect(out: Folder) -> None:
    """Have the next run read everything in its store: it was found to differ where sizes and listings do not show it."""
    (out / SUSPECT).touch()


def is_suspect(out: Folder) -> bool:
    return (out / SUSPECT).is_file()


def mend(run: Run) -> list[str]:
    """Make due again what a run's store has lost; lines that say what that is.

    Raises StoreError where nothing can be read any more.
    """
    if not run.store.is_dir():
        return []
    said = _mend(run, thorough=is_suspect(run.folder))
    (run.folder / SUSPECT).unlink(missing_ok=True)
    return said


def _mend(run: Run, *, thorough: bool) -> list[str]:
    """thorough: every chunk is read, whatever sizes say, and compared with its record."""
    said = []
    if back := roll_back_to_readable(run.store, _read_plan_tables):
        said.append(
            f"{run.store}: the newest snapshot cannot be read ({back.reason}); the run goes on from that of "
            f"{back.made:%Y-%m-%d %H:%M:%S} UTC, and what was made since is due again"
        )
    if not run.store.is_dir():  # it was never begun
        return said
    repository = open_repository(run.store)
    session = repository.writable_session(BRANCH)
    if repository.lookup_snapshot(session.snapshot_id).parent_id is None:
        return said
    try:
        group = open_root(session)
    except FormatError:  # the ingest begins it anew
        return said
    if group.attrs.get("block", run.block) != run.block:
        return said
    due: dict[str, set[int]] = {}
    plan: Plan | None = None
    if thorough or not has_all_files(repository, run.store):
        for tag in find_broken_tags(repository, run.store):
            repository.delete_tag(tag)
            said.append(
                f"{run.store}: tag {tag} cannot be read and is removed; the street stands in the newest snapshot"
            )
        if lost := find_unreadable_chunks(session):
            plan = read_plan(session)
            due = give_up(group, plan, lost)
        if thorough:
            plan = plan or read_plan(session)
            for stage, units in differing(group, plan).items():
                due.setdefault(stage, set()).update(units)
    wounds = find_wounds(session)
    if not due and not wounds:
        return said
    plan = plan or read_plan(session)
    records = read_journal(group, "streets")
    wounds["streets"] = [
        street
        for street in wounds.get("streets", ())
        if is_done(records[street], street_keys(run, plan, group, street).street)
    ]
    for stage, units in wounds.items():
        due.setdefault(stage, set()).update(units)
    if line := _forget(group, plan, due):
        commit(session, f"mend: {line}")
        said.append(f"{run.store}: {line} lost what they made; they are due again")
    return said


def _forget(group: StoreGroup, plan: Plan, due: dict[str, set[int]]) -> str:
    """Forget units, and the streets that write where those seed; says which these are."""
    charts = [int(plan.facades.chart[facade]) for facade in due.get("facades", ())]
    buildings = plan.textured_buildings()
    charts += [chart for unit in due.get("textures", ()) for chart in plan.own_charts(buildings[unit])]
    charts += plan.ground_near_cameras()[sorted(due.get("grounds", ()))].tolist()
    walls = list(plan.walls_near_cameras().values())
    charts += [chart for unit in due.get("walls", ()) for chart in walls[unit]]
    due.setdefault("streets", set()).update(units_of_charts(plan, charts)["streets"])
    for stage in STAGES:
        for unit in sorted(due.get(stage, ())):
            clear_record(group, stage, unit)
    clear_rasters(group, plan.scene.spec, plan.scene.placement, sorted(set(charts)), "facades")
    names = _names(plan)
    told = []
    for stage in STAGES:
        if units := sorted(due.get(stage, ())):
            known = [names[stage][u] if stage in names else str(u) for u in units[:NAMED]]
            known += ["..."] if len(units) > NAMED else []
            told.append(f"{len(units)} {stage.removesuffix('s') if len(units) == 1 else stage} ({', '.join(known)})")
    return ", ".join(told)


def _names(plan: Plan) -> dict[str, Sequence[str]]:
    streets = [street.id for street in plan.streets]
    return {
        "facades": plan.facades.id,
        "streets": streets,
        "viewpoints": [f"{streets[one.street]}, {one.id}" for one in plan.viewpoints],
        "textures": [plan.scene.names[building] for building in plan.textured_buildings()],
        "grounds": names_of_ground(plan),
        "walls": names_of_walls(plan),
        "surfaces": [name for name, _ in parts_of_block(plan)],
    }


def _read_plan_tables(session: icechunk.Session) -> None:
    """Read what of a snapshot cannot be made again unit by unit."""
    group = open_root_of_any_format(session)
    for name, table in group.groups():
        if name not in MADE:
            for _, array in table.arrays():
                array[...]
    for name in MADE:
        # a block may have no exemplars, and a store of before none of the folders
        if name not in ("exemplars", *FOLDERS) or name in group:
            dict(group[name].attrs)


def _done(record: Record | None) -> bool:
    return record is not None and record["status"] == "done"


def _without_panorama(session: icechunk.Session, group: StoreGroup, records: Records) -> list[int]:
    """Viewpoints that are done, and no panorama is listed. One that is black has no chunk: its record says so."""
    there = {chunk[0] for chunk in list_chunks(session, "panoramas/rgb")}
    black = ""
    found = []
    for viewpoint, record in enumerate(records):
        if record is None or not _done(record) or viewpoint in there:
            continue
        black = black or picture_digest(np.zeros(group["panoramas/rgb"].shape[1:], np.uint8))
        if record.get("panorama") != black:
            found.append(viewpoint)
    return found


def _without_rasters(session: icechunk.Session, records: Records) -> list[int]:
    """Facades that are done, of every texel, and of whose chart a chunk is not listed."""
    made = [i for i, r in enumerate(records) if _done(r) and r and r.get("provenance", [1])[0] == 0]
    if not made:
        return []
    chart_of = open_table(session, "facades").chart.values
    lost = _charts_without(session, "atlas/seed_evidence", chart_of[made].tolist())
    return [f for f in made if int(chart_of[f]) in lost]


def _without_seeds(session: icechunk.Session, records: Records) -> list[int]:
    """Units from panoramas of which no chunk is listed: where none shows a chart, a chunk is empty and never written."""
    made = {name: i for i, record in enumerate(records) if record and _done(record) for name in record["digests"]}
    if not made:
        return []
    ids = open_table(session, "charts").id.values.tolist()
    table, there = read_table(session, "charts"), list_chunks(session, "atlas/seed_evidence")
    placement = placement_of(table, float(open_root(session)["atlas"].attrs["texels_per_metre"]))
    return sorted(
        made[f"{ids[chart]:016x}"]
        for chart, number in enumerate(ids)
        if f"{number:016x}" in made
        and there.isdisjoint(map(tuple, placement.chunks(chart, table["chunk"], table["gutter"]).tolist()))
    )


def _without_texels(session: icechunk.Session, records: Records) -> list[int]:
    """Finished surfaces of whose charts a chunk is not listed: each of their texels is from somewhere."""
    if not any(map(_done, records)):
        return []
    ids = open_table(session, "charts").id.values.tolist()
    lost = {f"{ids[chart]:016x}" for chart in _charts_without(session, "atlas/provenance", range(len(ids)))}
    return [i for i, r in enumerate(records) if r and _done(r) and not lost.isdisjoint(r["digests"])]


def _charts_without(session: icechunk.Session, array: str, charts: Iterable[int]) -> set[int]:
    """Those of some charts of which a chunk of an array over the pages is not listed."""
    table, there = read_table(session, "charts"), list_chunks(session, array)
    placement = placement_of(table, float(open_root(session)["atlas"].attrs["texels_per_metre"]))
    chunk, gutter = table["chunk"], table["gutter"]
    return {c for c in charts if not there.issuperset(map(tuple, placement.chunks(c, chunk, gutter).tolist()))}


def _over_other_viewpoints(
    session: icechunk.Session, streets: Records, viewpoints: Records, lost: Sequence[int]
) -> list[int]:
    """Streets that are done, and one of whose viewpoints is not, or is another than the street was made of; none that were made
    of a field."""
    street_of = open_table(session, "viewpoints").street.values
    viewpoints_of, away = RowIndex(street_of), set(lost)
    held = [None if i in away or not _done(record) else record for i, record in enumerate(viewpoints)]
    found = []
    for street, record in enumerate(streets):
        if record is None or not _done(record) or not record.get("chain"):
            continue
        keys = [one["key"] if (one := held[v]) else None for v in viewpoints_of.rows_with(street).tolist()]
        if None in keys or record["chain"] != unit_key(keys):
            found.append(street)
    return found
