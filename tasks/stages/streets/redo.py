"""Streets that are done again on request. Imported before Prefect, so it has no tasks."""

from __future__ import annotations

from difflib import get_close_matches

from catalogs.printable_text import normal_form
from facade_core.atlas.journal import clear_record
from facade_core.atlas.store import BRANCH, commit, open_repository, open_root
from facade_core.core.errors import InputError
from facade_core.plan.plan import Plan
from tasks.engine.context import load_run_plan
from tasks.engine.run import Run


def schedule_street_redo(run: Run, street: str) -> list[str]:
    """Make the streets of an id or name pending again by deleting their records; returns their ids.

    Raises
    ------
    InputError : the street is unknown, or everything is pending anyway.
    """
    session = open_repository(run.store).writable_session(BRANCH)
    group = open_root(session)
    if group.attrs.get("key") != run.key:
        raise InputError(f"{run.out}: its inputs or the code changed since it was made; run it without --redo first")
    plan = load_run_plan(run)
    chosen = find_streets(plan, street)
    for index in chosen:
        clear_record(group, "streets", index)
    names = [plan.streets[index].id for index in chosen]
    commit(session, f"redo {', '.join(names)}")
    return names


def find_streets(plan: Plan, street: str) -> list[int]:
    """Return the streets of an id or name.

    Raises
    ------
    InputError : the street is unknown.
    """
    chosen = [i for i, one in enumerate(plan.streets) if normal_form(street) in (one.id, one.name)]
    if not chosen:
        known = sorted({one.name or one.id for one in plan.streets})
        near = get_close_matches(street, known, n=1, cutoff=0.4) or known[:1]
        raise InputError(f"no street has the id or name {street!r}; there is {near[0]!r} among {len(known)}")
    return chosen
