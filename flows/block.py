"""Flow of one city block: ingest, poses, facades, streets, publish."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from itertools import chain
from pathlib import Path
from queue import SimpleQueue
from typing import cast

from prefect import State, flow
from prefect.runtime import flow_run
from prefect.states import Completed
from prefect.task_runners import ThreadPoolTaskRunner

from catalogs.block.yaml_files import read_yaml
from catalogs.printable_text import format_count
from catalogs.published.folders import Folder, local_run_folder
from catalogs.published.s3 import folder_at
from facade_core.core.errors import TooManyFailuresError
from facade_core.core.json_types import JsonObject
from flows.artifacts import describe_failure_count, record_block
from flows.console import print_status
from flows.lock import lock_folder
from flows.run_entry import HeldRun, handle_store_and_machine_faults, open_run
from flows.submission import Submit, TaskFuture, queue_end, submit_tasks
from tasks.engine.compute.connect import Compute, connect
from tasks.engine.compute.distributed_map import map_on_workers
from tasks.engine.fan_out import BATCHES_AT_ONCE, make_batches, process_batch
from tasks.engine.forecast import describe_rejected_inputs, forecast_work
from tasks.engine.outcome import UnitOutcomeCounts, count_set_aside, list_reasons, list_units_with_rejections
from tasks.engine.pending import PendingUnits, find_pending_units
from tasks.engine.progress import begin_stage
from tasks.engine.run import Run
from tasks.engine.store.disk_space import require_disk_space
from tasks.examples.demo import NAME, write_demo
from tasks.harvest import note_few_exemplars
from tasks.harvest.block_style import harvest_block_style
from tasks.preview import start_preview
from tasks.publish.prune import prune_snapshots_or_explain
from tasks.publish.task import publish_block
from tasks.stages.facades.stage import FACADES
from tasks.stages.ingest.task import ingest_block
from tasks.stages.order import STAGES_IN_ORDER

log = logging.getLogger(__name__)

# Threads of tasks; they only wait for workers, of which a cluster may have many.
MAX_CONCURRENT_TASKS = 64


def block_run_name() -> str:
    """Return the block and the scheduled date, under which the UI lists the run."""
    block_file = flow_run.parameters.get("block_file")
    name = NAME
    if block_file is not None:
        try:
            # another document than a mapping raises TypeError
            name = cast(JsonObject, read_yaml(Path(block_file)))["name"]
        except (ValueError, TypeError, KeyError):  # the run itself reports the error in the file
            name = Path(block_file).stem
    return f"{name} {flow_run.scheduled_start_time:%Y-%m-%d %H:%M}"


@flow(
    name="city-block",
    description="Texture a city block: facades, streets, atlas, model and catalogue. Resumes by itself.",
    flow_run_name=block_run_name,
    task_runner=ThreadPoolTaskRunner(max_workers=MAX_CONCURRENT_TASKS),  # type: ignore[arg-type]
)
def city_block(
    block_file: Path | None = None,
    out: str | Path | None = None,
    workers: int = 2,
    dask: str | None = None,
    deadline: float | None = None,
    keep: int | None = None,
) -> JsonObject | State[JsonObject]:
    """Texture the block of `block_file` into `out`; resumable and idempotent.

    Parameters
    ----------
    block_file : the block; None for the embedded demo.
    out : folder or s3://bucket/prefix of the results; None for out/NAME of the block file.
    workers : number of local processes.
    dask : address of a Dask scheduler that replaces the local processes, such as tcp://127.0.0.1:8786.
    deadline : hours after the scheduled time at which the run ends, finished or not; committed work is kept.
    keep : number of newest published snapshots to keep; None for all.

    Returns
    -------
    summary : counts, failures and outputs of the run; in a `Completed` state where units failed.
    """
    summary = texture_block(block_file, out, workers, dask, deadline, keep)
    if "withheld" in summary:
        raise TooManyFailuresError(summary["withheld"])
    if summary["failures"]:
        # not Failed: all else is published, and a retry would change nothing
        return Completed(name="UnitsFailed", message=describe_failure_count(summary), data=summary)
    return summary


def texture_block(
    block_file: Path | None = None,
    out: str | Folder | None = None,
    workers: int = 2,
    dask: str | None = None,
    deadline: float | None = None,
    keep: int | None = None,
) -> JsonObject:
    """Texture a block; Prefect records it inside a flow run. Continues where this process has begun.

    Parameters
    ----------
    block_file, out, workers, dask, deadline, keep : as of `city_block`.

    Returns
    -------
    summary : counts, failures and outputs of the run.
    """
    folder = folder_at(out or Path("out") / (block_file.stem if block_file else "demo"))
    with lock_folder(folder):
        source = block_file or write_demo(local_run_folder(folder) / "input")
        with (
            open_run(source, folder, notify=print_status) as entry,
            record_block(entry) as record,
            submit_tasks(MAX_CONCURRENT_TASKS) as submit,
        ):
            if entry.summary is None:
                entry.summary = _texture_block(entry, workers, dask, _deadline_clock(deadline), submit)
            summary = entry.summary
            if keep is not None:
                for line in prune_snapshots_or_explain(folder, keep):
                    print_status(line)
            record(summary)
    return summary


def _deadline_clock(deadline: float | None) -> float | None:
    """Convert hours after the scheduled start to `time.monotonic()`; a retry does not extend the deadline."""
    if deadline is None:
        return None
    started: datetime = flow_run.scheduled_start_time
    elapsed = datetime.now(UTC) - started
    return time.monotonic() + deadline * 3600 - elapsed.total_seconds()


def _texture_block(
    entry: HeldRun, workers: int, dask: str | None, deadline: float | None, submit: Submit
) -> JsonObject:
    run = entry.run
    block = harvest_block_style(entry.block, run.folder, workers=workers, dask=dask, notify=print_status)
    print_status(f"{block.name}: {format_count(len(block.buildings), 'building')} at {block.describe_place()}")
    if block.exemplars and (note := note_few_exemplars(len(block.exemplars))):
        print_status(note)
    # a local cluster starts in parallel with the ingest; a named one is checked first, as it may be unavailable
    ready: Future[Compute] = Future()
    map_units = partial(map_on_workers, ready)
    ingest = submit(ingest_block, run, block, map_units) if dask is None else None
    # again here, because the error must also end the flow where the command line opened the run
    with (
        handle_store_and_machine_faults(run),
        _publish_connection(connect(workers, dask, run.out, deadline), ready) as compute,
    ):
        outline = (ingest or submit(ingest_block, run, block, map_units)).result()
        run = replace(run, ingested=outline.ingested)
        for line in describe_rejected_inputs(outline.set_aside):
            print_status(line)
        forecast = forecast_work(run, block, outline)
        if forecast.said:
            print_status(forecast.said)
        outcome = UnitOutcomeCounts()
        has_changed = False
        for kind in STAGES_IN_ORDER:
            # the units of the forecast, unless a result that their inputs may hold has changed since
            known = None if has_changed else forecast.units.get(kind.stage)
            pending = find_pending_units(run, block, kind, known)
            # the page of a city shows its finished blocks
            if kind is FACADES and pending.pieces and not pending.done and block.part is None:
                start_preview(run, list(chain.from_iterable(pending.pieces)), compute, print_status)
            ended = run_stage(run, pending, compute, submit)
            has_changed |= bool(ended.done or ended.failed)
            outcome += ended
        require_disk_space(run.local)
        published = submit(publish_block, run, entry.source).result()
    outcome += count_set_aside(outline.set_aside)
    unpublished = published.pop("unpublished", [])
    return published | {
        "out": run.out,
        "units_skipped": outcome.skipped + (1 if outline.skipped else 0),
        "units_done": outcome.done + (0 if outline.skipped else 1),
        "failures": list_reasons(outcome.failed) + unpublished,
        "refused": list_reasons(outcome.refused),
    }


@contextmanager
def _publish_connection(connecting: AbstractContextManager[Compute], ready: Future[Compute]) -> Iterator[Compute]:
    """Connect to workers and pass the connection to `ready`; cancel `ready` where the connection fails."""
    try:
        with connecting as compute:
            ready.set_result(compute)
            yield compute
    finally:
        ready.cancel()


def run_stage(run: Run, pending: PendingUnits, compute: Compute, submit: Submit) -> UnitOutcomeCounts:
    """Run all batches of a stage, at most BATCHES_AT_ONCE at a time."""
    if not pending.total:
        return UnitOutcomeCounts()
    require_disk_space(run.local)
    stage, function = pending.stage.stage, pending.stage.function
    begin_stage(stage, pending.total, len(pending.done))
    outcome = UnitOutcomeCounts(skipped=len(pending.done), refused=list_units_with_rejections(pending.done))
    waiting = list(make_batches(pending.pieces, compute))
    outcomes: dict[int, UnitOutcomeCounts] = {}
    ended: SimpleQueue[tuple[int, TaskFuture[UnitOutcomeCounts]]] = SimpleQueue()
    for number, batch in enumerate(waiting, 1):
        if number > BATCHES_AT_ONCE:
            _take_next_result(ended, outcomes)
        future = submit(process_batch, run, stage, f"{number} of {len(waiting)}", function, batch, compute, name=stage)
        queue_end(ended, number, future)
    while len(outcomes) < len(waiting):
        _take_next_result(ended, outcomes)
    outcome += sum((outcomes[number] for number in sorted(outcomes)), UnitOutcomeCounts())
    _log_stage(stage, outcome)
    return outcome


def _take_next_result(
    ended: SimpleQueue[tuple[int, TaskFuture[UnitOutcomeCounts]]], outcomes: dict[int, UnitOutcomeCounts]
) -> None:
    """Wait for the next result and store it; its exception ends the run at once."""
    number, future = ended.get()
    outcomes[number] = future.result()


def _log_stage(stage: str, outcome: UnitOutcomeCounts) -> None:
    log.info("%s: %d done, %d done before, %d failed", stage, outcome.done, outcome.skipped, len(outcome.failed))
