"""Bring the textures that buildings carry into the atlas, a building at a time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from prefect import task
from prefect.cache_policies import NO_CACHE

from facade_core.atlas.journal import unit_key
from facade_core.atlas.store import BRANCH, open_repository, open_table
from tasks.commits import begin, finish, journal
from tasks.compute import Compute
from tasks.outcome import Outcome, failure, is_done
from tasks.progress import advance, begin_stage
from tasks.run import Run
from tasks.units.texture import texture_unit


@task(name="own textures", cache_policy=NO_CACHE)
def keep_textures(run: Run, buildings: Sequence[int], textures: Sequence[Path], compute: Compute) -> Outcome:
    """Write the textured charts of `buildings` that the journal does not hold yet; one commit per building."""
    if not buildings:
        return Outcome()
    held = journal(run.store, "textures")
    names = open_table(open_repository(run.store).readonly_session(BRANCH), "buildings").id.values
    keys = [unit_key(run.key, "texture", str(names[building])) for building in buildings]
    due = [i for i, key in enumerate(keys) if not is_done(held[i], key)]
    outcome = Outcome(skipped=len(buildings) - len(due))
    begin_stage("textures", len(buildings))
    advance("textures", outcome.skipped)
    started: dict[Any, tuple[int, Any]] = {}
    for i in due:
        session, fork = begin(run.store)
        name = str(names[buildings[i]])
        started[compute.submit(texture_unit, run, fork, buildings[i], name, keys[i], textures)] = (i, session)
    for future in compute.completed(started):
        i, session = started[future]
        name = str(names[buildings[i]])
        try:
            fork, record = future.result()
        except Exception as error:
            session, fork = begin(run.store)
            record = failure(name, keys[i], error)
        finish(session, fork, "textures", {i: record}, f"textures of {name}")
        made = Outcome().add([record])
        advance("textures", made.finished, len(made.failed))
        outcome += made
    return outcome
