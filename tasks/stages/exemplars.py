"""The exemplar library: every exemplar parsed, completed and measured once."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tasks.keys.units import exemplar_key
from tasks.outcome import is_done
from tasks.run import Run
from tasks.stages.fan_out import Stage, Work
from tasks.store.commits import journal
from tasks.units.exemplar import exemplar_unit
from tasks.units.memory import exemplar_memory


def exemplars_due(run: Run, paths: Sequence[Path]) -> Stage:
    """The exemplars that the journal does not hold yet; one that cannot be used will be set aside with its reason."""
    held = journal(run.store, "exemplars")
    keys = [exemplar_key(run, path) for path in paths]
    due = [i for i, key in enumerate(keys) if not is_done(held[i], key)]
    work = [Work({i: (paths[i].stem, keys[i])}, (i, paths[i], keys[i]), exemplar_memory(paths[i])) for i in due]
    return Stage("exemplars", exemplar_unit, work, held=[r for i, r in enumerate(held) if r and i not in due])
