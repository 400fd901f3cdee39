"""Units of a stage in batches: fanned out to workers, each committed with its journal records as it completes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from prefect import task
from prefect.cache_policies import NO_CACHE

from facade_core.atlas.arrays import clear_rasters
from facade_core.atlas.store import open_root
from tasks.engine.compute.connect import Compute
from tasks.engine.context import plan_of_run
from tasks.engine.outcome import Outcome, failure, log_units, machine_error, machine_fault
from tasks.engine.progress import advance
from tasks.engine.run import Run
from tasks.engine.store.commits import begin, finish
from tasks.engine.unit import Piece, UnitFunction

# Batches on their way at once: while the last units of one are awaited, the next one's keep the workers busy.
AT_ONCE = 2
# Pieces in a batch at most, or one for each thread of a large cluster: what is repeated for a lost coordinator stays small.
LARGEST = 24


def batches(pieces: Iterable[Piece], compute: Compute) -> Iterator[list[Piece]]:
    """Pieces in order, in batches of which AT_ONCE fit the workers' memory together; what is larger has one of its own."""
    most, largest = compute.memory // AT_ONCE, max(LARGEST, compute.threads)
    batch: list[Piece] = []
    memory = 0
    for piece in pieces:
        memory += memory_of(piece)
        if batch and (memory > most or len(batch) == largest):
            yield batch
            batch, memory = [], memory_of(piece)
        batch.append(piece)
    if batch:
        yield batch


def memory_of(piece: Piece) -> int:
    """What a worker needs for units that it does one after the other, bytes."""
    return max(unit.memory for unit in piece)


@task(name="units", task_run_name="{stage} {number}", cache_policy=NO_CACHE)
def process_batch(
    run: Run, stage: str, number: str, function: UnitFunction, batch: Sequence[Piece], compute: Compute
) -> Outcome:
    """Do a batch; each piece is committed, and its result released, as it completes.

    What raises as a whole leaves a failed record for each of its units, and nothing else. Raises MachineError where the machine
    is at fault, or the cluster went away; what was committed stays.
    """
    started: dict[Any, tuple[Piece, Any]] = {}
    for piece in batch:
        session, fork = begin(run.store)
        started[compute.submit(function, run, fork, piece, memory=memory_of(piece))] = (piece, session)
    outcome = Outcome()
    for future in compute.completed(list(started)):
        piece, session = started.pop(future)
        try:
            fork, records = future.result()
        except Exception as error:
            if machine_fault(error):
                raise machine_error(f"{stage} {_names(piece)}", error) from error
            session, fork = begin(run.store)
            _clear(run, stage, fork, piece)
            records = {unit.index: failure(unit.name, unit.key, error) for unit in piece}
        finish(session, fork, stage, records, f"{stage} {_names(piece)}")
        log_units(stage, records.values())
        del future, fork  # with the last reference its result leaves the cluster
        ended = Outcome().add(records.values())
        advance(stage, ended.finished, len(ended.failed))
        outcome += ended
    return outcome


def _clear(run: Run, stage: str, fork: Any, piece: Piece) -> None:
    """Have nothing lie where units failed: what was there is of what they stood on before."""
    if charts := [chart for unit in piece for chart in unit.charts]:
        scene = plan_of_run(run).scene
        clear_rasters(open_root(fork), scene.spec, scene.placement, charts, stage)


def _names(piece: Piece) -> str:
    return ", ".join(unit.name for unit in piece)
