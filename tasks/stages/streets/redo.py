"""Streets that are done again on request, with their dependants. Imported before Prefect, so it has no tasks."""

from __future__ import annotations

from dataclasses import dataclass
from difflib import get_close_matches

from facade_core.atlas.journal import clear_record, read_journal, write_record
from facade_core.atlas.store import BRANCH, commit, open_repository, open_root
from facade_core.core.errors import InputError
from facade_core.plan.plan import Plan
from tasks.engine.context import load_run_plan
from tasks.engine.run import Run


@dataclass(frozen=True)
class StreetsToRedo:
    """Streets to do again, and later ones that read their texels, by index in the order of waves."""

    streets: tuple[int, ...]
    dependants: tuple[int, ...]


def schedule_street_redo(run: Run, street: str, *, only: bool) -> tuple[list[str], list[str]]:
    """Make a street and its dependants pending again by deleting their records.

    With `only`, dependants keep their texels and are marked stale; the next run updates them.

    Returns
    -------
    names : ids of the streets, and of their dependants.

    Raises
    ------
    InputError : the street is unknown, or everything is pending anyway.
    """
    session = open_repository(run.store).writable_session(BRANCH)
    group = open_root(session)
    if group.attrs.get("key") != run.key:
        raise InputError(f"{run.out}: its inputs or the code changed since it was made; run it without --redo first")
    plan = load_run_plan(run)
    found = find_streets_to_redo(plan, street)
    names = [[plan.streets[index].id for index in indices] for indices in (found.streets, found.dependants)]
    records = read_journal(group, "streets")
    for index in (*found.streets, *found.dependants):
        record = records[index]
        if index in found.streets or not only:
            clear_record(group, "streets", index)
            for viewpoint in plan.street_viewpoints(index):
                clear_record(group, "viewpoints", viewpoint.id)
        elif record and record["status"] == "done":
            reason = f"street {' and '.join(names[0])} was done again without it; run the block to bring it up to date"
            write_record(group, "streets", index, record | {"status": "stale", "reason": reason})
    commit(session, f"redo {', '.join(names[0])}")
    return names[0], names[1]


def find_streets_to_redo(plan: Plan, street: str) -> StreetsToRedo:
    """Find the streets of an id or name, and the later ones that read their texels."""
    chosen = [i for i, one in enumerate(plan.streets) if street in (one.id, one.name)]
    if not chosen:
        known = sorted({one.name or one.id for one in plan.streets})
        near = get_close_matches(street, known, n=1, cutoff=0.4) or known[:1]
        raise InputError(f"no street has the id or name {street!r}; there is {near[0]!r} among {len(known)}")
    reads, writes = zip(*(street_read_write_chunks(plan, i) for i in range(len(plan.streets))), strict=True)
    changed = frozenset().union(*(writes[i] for i in chosen))
    dependants = []
    for index in sorted(range(len(plan.streets)), key=lambda i: (int(plan.wave[i]), i)):
        if index not in chosen and plan.wave[index] > min(plan.wave[chosen]) and reads[index] & changed:
            dependants.append(index)
            changed |= writes[index]
    return StreetsToRedo(tuple(sorted(chosen, key=lambda i: int(plan.wave[i]))), tuple(dependants))


def select_streets(run: Run, only: str | None) -> frozenset[int] | None:
    """Return the streets with the requested id or name; None if none is requested."""
    return None if only is None else frozenset(find_streets_to_redo(load_run_plan(run), only).streets)


def street_read_write_chunks(plan: Plan, street: int) -> tuple[frozenset[str], frozenset[str]]:
    """Return the chunks that a street reads, and the chunks that it writes, as "page/row/column"."""
    charts = plan.charts_of_street(street)
    spec, placement = plan.scene.spec, plan.scene.placement
    reads, writes = set(), set()
    for chart in charts.tolist():
        cells = {"/".join(map(str, cell)) for cell in placement.chunks(chart, spec.chunk, spec.gutter).tolist()}
        reads |= cells
        if plan.writable[chart]:
            writes |= cells
    return frozenset(reads), frozenset(writes)
