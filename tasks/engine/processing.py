"""Processing of units on a worker: compute from the inputs, write to the atlas, record."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any, TypeVar, cast

from icechunk import ForkSession

from facade_core.atlas.journal import Record
from facade_core.atlas.store import open_root
from tasks.engine.atlas import Atlas
from tasks.engine.context import current_worker_name, reading_store
from tasks.engine.inputs import join_key, note_reads
from tasks.engine.run import Run
from tasks.engine.unit import Unit, UnitGroup

R = TypeVar("R")


# Computes the result of a unit from its inputs, and reads nothing else.
Compute = Callable[[Any], R]
# Writes the result of a unit to its own chunks; returns the fields of its record.
Write = Callable[[Atlas, Unit[Any], R], Mapping[str, object]]


def process_units(
    compute: Compute[R], write: Write[R], run: Run, fork: ForkSession, units: UnitGroup
) -> tuple[ForkSession, dict[int, Record]]:
    """Compute and write some units through a fork of the store; returns the fork and the records by index."""
    atlas = Atlas(run, open_root(fork))
    with reading_store(atlas.group):
        return fork, {unit.index: process_unit(compute, write, atlas, unit) for unit in units}


def process_unit(
    compute: Compute[R], write: Write[R], atlas: Atlas, unit: Unit[Any], *, is_whole: bool = False
) -> Record:
    """Compute and write one unit; returns its record, whose key names the inputs that were read, or with `is_whole` all."""
    started = time.time()
    inputs, read = note_reads(unit.inputs)
    result = compute(inputs)
    computed = time.time()
    fields = dict(write(atlas, unit, result))
    steps = cast(dict[str, float], fields.pop("seconds", {})) or {"compute": computed - started}
    seconds = steps | {"write": time.time() - computed}
    return cast(
        Record,
        {
            "unit": unit.name,
            "key": join_key(unit.digests, None if is_whole else read),
            "status": "done",
            "worker": current_worker_name(),
            "started": started,
            "seconds": {step: round(taken, 4) for step, taken in seconds.items()},
            **fields,
        },
    )
