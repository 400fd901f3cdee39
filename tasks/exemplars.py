"""Prepare the exemplar library: every exemplar parsed, completed and measured once."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from prefect import task
from prefect.cache_policies import NO_CACHE

from facade_core.atlas.journal import unit_key
from tasks.commits import begin, finish, journal
from tasks.compute import Compute
from tasks.outcome import Outcome, failure, is_done
from tasks.progress import advance, begin_stage
from tasks.run import Run
from tasks.units.exemplar import exemplar_unit


@task(name="prepare exemplars", cache_policy=NO_CACHE)
def prepare_exemplars(run: Run, paths: Sequence[Path], compute: Compute) -> Outcome:
    """Prepare each exemplar that the journal does not hold yet; one that cannot be used is set aside with its reason."""
    held = journal(run.store, "exemplars")
    keys = [unit_key(run.key, "exemplar", path.name) for path in paths]
    due = [i for i, key in enumerate(keys) if not is_done(held[i], key)]
    outcome = Outcome(skipped=len(paths) - len(due))
    begin_stage("exemplars", len(paths))
    advance("exemplars", outcome.skipped)
    started: dict[Any, tuple[int, Any]] = {}
    for index in due:
        session, fork = begin(run.store)
        started[compute.submit(exemplar_unit, run, fork, index, paths[index], keys[index])] = (index, session)
    for future in compute.completed(started):
        index, session = started[future]
        try:
            fork, records = future.result()
        except Exception as error:
            session, fork = begin(run.store)
            records = {index: failure(paths[index].stem, keys[index], error)}
        finish(session, fork, "exemplars", records, f"exemplar {paths[index].stem}")
        made = Outcome().add(records.values())
        advance("exemplars", made.finished, len(made.failed))
        outcome += made
    return outcome
