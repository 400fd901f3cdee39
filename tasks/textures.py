"""Bring the textures that buildings carry into the atlas, a building at a time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from prefect import task
from prefect.cache_policies import NO_CACHE

from facade_core.atlas.journal import unit_key
from facade_core.atlas.store import BRANCH, open_repository, open_table
from tasks.commits import journal
from tasks.compute import Compute
from tasks.fan_out import Work, fan_out
from tasks.outcome import Outcome, is_done
from tasks.progress import advance, begin_stage
from tasks.run import Run
from tasks.units.texture import texture_unit


@task(name="own textures", cache_policy=NO_CACHE)
def keep_textures(run: Run, buildings: Sequence[int], textures: Sequence[Path], compute: Compute) -> Outcome:
    """Write the textured charts of `buildings` that the journal does not hold yet; one commit per building."""
    if not buildings:
        return Outcome()
    held = journal(run.store, "textures")
    ids = open_table(open_repository(run.store).readonly_session(BRANCH), "buildings").id.values
    names = [str(ids[building]) for building in buildings]
    keys = [unit_key(run.key, "texture", name) for name in names]
    due = [i for i, key in enumerate(keys) if not is_done(held[i], key)]
    outcome = Outcome(skipped=len(buildings) - len(due))
    begin_stage("textures", len(buildings))
    advance("textures", outcome.skipped)
    work = [Work({i: (names[i], keys[i])}, (i, buildings[i], names[i], keys[i], textures)) for i in due]
    return outcome + fan_out(run, "textures", texture_unit, work, compute)
