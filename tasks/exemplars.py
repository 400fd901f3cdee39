"""Prepare the exemplar library: every exemplar parsed, completed and measured once."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from prefect import task
from prefect.cache_policies import NO_CACHE

from facade_core.atlas.journal import unit_key
from tasks.commits import journal
from tasks.compute import Compute
from tasks.fan_out import Work, fan_out
from tasks.outcome import Outcome, is_done
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
    work = [Work({i: (paths[i].stem, keys[i])}, (i, paths[i], keys[i])) for i in due]
    return outcome + fan_out(run, "exemplars", exemplar_unit, work, compute)
