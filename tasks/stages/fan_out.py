"""Units of a stage in batches: fanned out to workers, each committed with its journal records as it completes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from prefect import task
from prefect.cache_policies import NO_CACHE

from tasks.compute.connect import Compute
from tasks.outcome import Outcome, failure, log_units, machine_error, machine_fault
from tasks.progress import advance
from tasks.run import Run
from tasks.store.commits import begin, finish

# Batches on their way at once: while the last units of one are awaited, the next one's keep the workers busy.
AT_ONCE = 2
# Units in a batch at most, or one for each thread of a large cluster: what is repeated for a lost coordinator stays small.
LARGEST = 24


@dataclass(frozen=True)
class Work:
    """What one worker does in one go.

    units: (name, key) of its units by index; arguments of the function that does them; memory: bytes it takes at most,
    beside the libraries and the run's plan.
    """

    units: Mapping[int, tuple[str, str]]
    arguments: tuple
    memory: int


@dataclass(frozen=True)
class Stage:
    """The units of a stage that are due, and the records of those that the journal holds already.

    function(run, fork, *arguments) does one piece of work; it returns the fork and its units' records.
    """

    name: str
    function: Callable[..., Any]
    work: Sequence[Work] = ()
    held: Sequence[dict[str, Any]] = ()

    @property
    def skipped(self) -> int:
        return len(self.held)

    @property
    def total(self) -> int:
        return self.skipped + sum(len(piece.units) for piece in self.work)


def batches(work: Iterable[Work], compute: Compute) -> Iterator[list[Work]]:
    """Work in order, in batches of which AT_ONCE fit the workers' memory together; what is larger has one of its own."""
    most, largest = compute.memory // AT_ONCE, max(LARGEST, compute.threads)
    batch: list[Work] = []
    memory = units = 0
    for piece in work:
        memory, units = memory + piece.memory, units + len(piece.units)
        if batch and (memory > most or units > largest):
            yield batch
            batch, memory, units = [], piece.memory, len(piece.units)
        batch.append(piece)
    if batch:
        yield batch


@task(name="units", task_run_name="{stage} {number}", cache_policy=NO_CACHE)
def process_batch(
    run: Run, stage: str, number: str, function: Callable[..., Any], batch: Sequence[Work], compute: Compute
) -> Outcome:
    """Do a batch; each piece is committed, and its result released, as it completes.

    What raises as a whole leaves a failed record for each of its units, and nothing else. Raises MachineError where the machine
    is at fault, or the cluster went away; what was committed stays.
    """
    started: dict[Any, tuple[Work, Any]] = {}
    for piece in batch:
        session, fork = begin(run.store)
        started[compute.submit(function, run, fork, *piece.arguments, memory=piece.memory)] = (piece, session)
    outcome = Outcome()
    for unit in compute.completed(list(started)):
        piece, session = started.pop(unit)
        try:
            fork, records = unit.result()
        except Exception as error:
            if machine_fault(error):
                raise machine_error(f"{stage} {_names(piece)}", error) from error
            session, fork = begin(run.store)
            records = {index: failure(name, key, error) for index, (name, key) in piece.units.items()}
        finish(session, fork, stage, records, f"{stage} {_names(piece)}")
        log_units(stage, records.values())
        del unit, fork  # with the last reference its result leaves the cluster
        made = Outcome().add(records.values())
        advance(stage, made.finished, len(made.failed))
        outcome += made
    return outcome


def _names(piece: Work) -> str:
    return ", ".join(name for name, _ in piece.units.values())
