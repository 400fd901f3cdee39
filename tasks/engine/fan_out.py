"""Batches of units: fanned out to workers, each unit group committed with its records as it completes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import icechunk
from prefect import task
from prefect.cache_policies import NO_CACHE

from facade_core.atlas.arrays import clear_rasters
from facade_core.atlas.journal import Record
from facade_core.atlas.store import open_root
from tasks.engine.compute.cluster import SubmittedUnit
from tasks.engine.compute.connect import Compute
from tasks.engine.context import load_run_plan
from tasks.engine.outcome import UnitOutcomeCounts, failure_record, is_machine_fault, log_units, machine_error
from tasks.engine.progress import report_progress
from tasks.engine.run import Run
from tasks.engine.store.commits import commit_units, fork_store
from tasks.engine.unit import UnitFunction, UnitGroup

# Batches on their way at once: while the last units of one are awaited, the next one's keep the workers busy.
BATCHES_AT_ONCE = 2
# Pieces in a batch at most, or one for each thread of a large cluster: what is repeated for a lost coordinator stays small.
MAX_BATCH_PIECES = 24
# The fork that a unit group was written through, and its records by unit index.
UnitResult = tuple[icechunk.ForkSession, dict[int, Record]]


def make_batches(pieces: Iterable[UnitGroup], compute: Compute) -> Iterator[list[UnitGroup]]:
    """Split unit groups into batches, of which BATCHES_AT_ONCE fit the workers' memory together.

    A group that is larger has a batch of its own. The order stays.
    """
    most, largest = compute.memory // BATCHES_AT_ONCE, max(MAX_BATCH_PIECES, compute.threads)
    batch: list[UnitGroup] = []
    memory = 0
    for piece in pieces:
        memory += unit_group_memory(piece)
        if batch and (memory > most or len(batch) == largest):
            yield batch
            batch, memory = [], unit_group_memory(piece)
        batch.append(piece)
    if batch:
        yield batch


def unit_group_memory(piece: UnitGroup) -> int:
    """Return the bytes for a unit group, whose units run one after the other."""
    return max(unit.memory for unit in piece)


@task(name="units", task_run_name="{stage} {number}", cache_policy=NO_CACHE)
def process_batch(
    run: Run, stage: str, number: str, function: UnitFunction, batch: Sequence[UnitGroup], compute: Compute
) -> UnitOutcomeCounts:
    """Process a batch; each unit group is committed, and its result released, as it completes.

    A group that raises as a whole leaves a failed record for each of its units, and nothing else.

    Raises
    ------
    MachineError : the machine is at fault, or the cluster is gone; committed units stay.
    """
    started: dict[SubmittedUnit[UnitResult], tuple[UnitGroup, icechunk.Session]] = {}
    for piece in batch:
        session, fork = fork_store(run.store)
        started[compute.submit(function, run, fork, piece, memory=unit_group_memory(piece))] = (piece, session)
    outcome = UnitOutcomeCounts()
    for future in compute.iterate_completed(list(started)):
        piece, session = started.pop(future)
        try:
            fork, records = future.result()
        except Exception as error:
            if is_machine_fault(error):
                raise machine_error(f"{stage} {_unit_names(piece)}", error) from error
            session, fork = fork_store(run.store)
            _clear_charts(run, stage, fork, piece)
            records = {unit.index: failure_record(unit.name, unit.key, error) for unit in piece}
        commit_units(session, fork, stage, records, f"{stage} {_unit_names(piece)}")
        log_units(stage, records.values())
        del future, fork  # with the last reference its result leaves the cluster
        ended = UnitOutcomeCounts().add(records.values())
        report_progress(stage, ended.processed_count, len(ended.failed))
        outcome += ended
    return outcome


def _clear_charts(run: Run, stage: str, fork: icechunk.ForkSession, piece: UnitGroup) -> None:
    """Clear the charts of failed units: their texels belong to earlier inputs."""
    if charts := [chart for unit in piece for chart in unit.charts]:
        scene = load_run_plan(run).scene
        clear_rasters(open_root(fork), scene.spec, scene.placement, charts, stage)


def _unit_names(piece: UnitGroup) -> str:
    return ", ".join(unit.name for unit in piece)
