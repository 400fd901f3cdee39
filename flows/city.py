"""Flow of a city: its blocks, one or several at a time, and the products of the whole city."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from queue import Empty, SimpleQueue

import psutil
from prefect import State, flow
from prefect.runtime import flow_run
from prefect.states import Completed
from prefect.task_runners import ThreadPoolTaskRunner

from catalogs.printable_text import format_count
from catalogs.published.folders import Folder
from catalogs.published.s3 import folder_at
from facade_core.core.json_types import JsonObject
from flows.artifacts import publish_block_table
from flows.city_options import CityOptions, next_time_of_day
from flows.city_progress import PROGRESS_INTERVAL_S, CityProgress
from flows.console import format_duration, print_status
from flows.lock import lock_folder, require_lock
from flows.markdown import escape_markdown
from flows.output_folder import check_output_folder
from flows.step_reporter import report_steps
from flows.submission import TaskFuture, is_recorded, queue_end, submit_tasks
from tasks.city.block_process import run_block
from tasks.city.city_log import (
    BlockResult,
    CityLog,
    load_or_partition_city,
    write_block_result,
    write_city_summary,
    write_products_digest,
)
from tasks.city.city_products import write_city_products
from tasks.city.source_digests import block_code_version
from tasks.engine.commands import DEADLINE_EXIT_CODE
from tasks.engine.compute.connect import start_shared_workers

MAX_CONCURRENT_BLOCKS = 64

# Share of the time for updates of the city's products while blocks run, whose cost grows with the city; the end of the run
# updates them in any case.
MAX_PRODUCT_TIME_SHARE = 0.05


def city_run_name() -> str:
    """Return the city and the scheduled date of the run."""
    return f"{Path(flow_run.parameters['city_file']).stem} {flow_run.scheduled_start_time:%Y-%m-%d %H:%M}"


@flow(
    name="city",
    description="Texture a city block by block. Resumes by itself; what did not change is not done again.",
    flow_run_name=city_run_name,
    task_runner=ThreadPoolTaskRunner(max_workers=MAX_CONCURRENT_BLOCKS),  # type: ignore[arg-type]
)
def city(
    city_file: Path,
    out: str | Path | None = None,
    workers: int = 2,
    dask: str | None = None,
    at_once: int = 2,
    until: str | None = None,
    keep: int | None = None,
    tiles: bool = True,
    restyle: bool = False,
) -> JsonObject | State[JsonObject]:
    """Texture the city of `city_file` into `out`; resumable and idempotent.

    Parameters
    ----------
    city_file : the city.
    out : folder or s3://bucket/prefix of the results, each block a run in out/blocks/NAME; None for out/NAME of the
        city file.
    workers : number of local processes, which the blocks share.
    dask : address of a Dask scheduler that all blocks share instead.
    at_once : number of concurrent blocks.
    until : local time of day, such as 06:00, at which the run ends, finished or not; committed work is kept. It is the
        next such time after the scheduled start: a later start or retry begins no block.
    keep : number of newest published snapshots of each block to keep; None for all.
    tiles : export the 3D Tiles of each block, which out/tileset.json references.
    restyle : choose the exemplars of all buildings again.

    Returns
    -------
    summary : counts, failures and outputs of the run; in a `Completed` state where blocks failed or are left.
    """
    summary = texture_city(city_file, out, CityOptions(workers, dask, at_once, until, keep, tiles, restyle))
    if summary["failures"] or summary["left"]:
        counts = f"{summary['blocks_done']} of {summary['blocks']} blocks are done; {len(summary['left'])} are left"
        failed = "; ".join(f"{failure['unit']}: {failure['reason']}" for failure in summary["failures"][:3])
        return Completed(name="BlocksLeft", message=escape_markdown(f"{counts}. {failed}"), data=summary)
    return summary


def texture_city(city_file: Path, out: str | Folder | None, options: CityOptions) -> JsonObject:
    """Texture a city; Prefect records it inside a flow run.

    Parameters
    ----------
    city_file, out : as of `city`.
    options : its other parameters.

    Returns
    -------
    summary : counts, failures and outputs of the run.
    """
    out = folder_at(out or Path("out") / city_file.stem)
    scheduled = flow_run.scheduled_start_time.astimezone().replace(tzinfo=None)
    started = time.monotonic()
    check_output_folder(out)
    ends = None if options.until is None else next_time_of_day(options.until, scheduled).timestamp()
    with lock_folder(out), ExitStack() as cleanup:
        submit = cleanup.enter_context(submit_tasks(MAX_CONCURRENT_BLOCKS))
        with report_steps() as notify:
            account, files = load_or_partition_city(city_file, out, notify)
        due = list(account.blocks) if options.restyle else account.pending_blocks(out, tiles=options.tiles)
        estimate = account.estimate(due, options.workers, options.at_once)
        duration = f", about {format_duration(3600 * estimate['hours'])}" if due else ""
        print_status(f"{format_count(len(account.blocks), 'block')}, {len(due)} of them pending{duration}")
        workers = cleanup.enter_context(_start_workers(options, len(due)))
        progress = CityProgress(out, account, due, options)
        ended: SimpleQueue[tuple[str, TaskFuture[BlockResult]]] = SimpleQueue()
        waiting, running, next_update = deque(due), progress.running, 0.0
        while waiting or running:
            while waiting and len(running) < options.at_once and (ends is None or time.time() < ends):
                name = waiting.popleft()
                before, digest = account.blocks[name], account.digests[name]
                future = submit(
                    run_block,
                    out,
                    name,
                    files[name],
                    replace(options, dask=workers.address).block_arguments(),
                    before,
                    digest,
                    block_code_version(),
                    ends,
                    options.tiles,
                )
                queue_end(ended, name, future)
                running.append(name)
            if not running:
                break
            name, future = _next_result(ended, progress)
            outcome = future.result()
            account = account.with_result(name, outcome)
            require_lock(out)
            write_block_result(out, name, outcome)
            progress.end_block(name, account)
            print_status(f"block {name}: {_describe_block_outcome(outcome)}; {len(waiting) + len(running)} to go")
            if time.monotonic() >= next_update:
                account, took = _write_city_products(out, account)
                next_update = time.monotonic() + took / MAX_PRODUCT_TIME_SHARE
        account, _ = _write_city_products(out, account)
        left = [name for name in account.blocks if name in waiting or account.blocks[name].code == DEADLINE_EXIT_CODE]
        summary = account.summary(out) | {"blocks_skipped": len(account.blocks) - len(due), "left": left}
        summary["seconds"] = round(time.monotonic() - started, 2)
        spent = workers.processor_seconds() + sum(account.blocks[name].processor for name in due if name not in waiting)
        taken = {"hours_taken": summary["seconds"] / 3600, "processor_hours_taken": spent / 3600}
        summary["estimate"] = estimate | {name: float(f"{value:.3g}") for name, value in taken.items()}
        write_city_summary(out, summary)
    return summary


@dataclass(frozen=True)
class _Workers:
    """Workers that the blocks share.

    Attributes
    ----------
    address : their scheduler; None where each block starts its own.
    processes : the local ones that the city started.
    """

    address: str | None
    processes: tuple[psutil.Process, ...] = ()

    def processor_seconds(self) -> float:
        """Return the processor seconds of the local processes."""
        seconds = 0.0
        for process in self.processes:
            with suppress(psutil.Error):
                seconds += sum(process.cpu_times()[:2])
        return seconds


@contextmanager
def _start_workers(options: CityOptions, blocks: int) -> Iterator[_Workers]:
    """Start local workers that several blocks share; a single block, or one with a single worker, needs none."""
    if options.dask is not None or options.workers < 2 or blocks < 2:
        yield _Workers(options.dask)
        return
    with start_shared_workers(options.workers) as address:
        yield _Workers(address, tuple(psutil.Process().children(recursive=True)))


def _next_result(
    ended: SimpleQueue[tuple[str, TaskFuture[BlockResult]]], progress: CityProgress
) -> tuple[str, TaskFuture[BlockResult]]:
    """Wait for the next block that ends, and print the progress of the running ones meanwhile."""
    while True:
        try:
            return ended.get(timeout=PROGRESS_INTERVAL_S)
        except Empty:
            print_status(progress.describe())


def _write_city_products(out: Folder, account: CityLog) -> tuple[CityLog, float]:
    """Report the blocks' state; write the city's products unless they match the newest snapshots.

    Returns the account with the snapshots of the products, and the seconds that this took.
    """
    started = time.monotonic()
    if is_recorded():
        publish_block_table(account)
    require_lock(out)
    if account.over != (snapshots := account.products_digest()) and write_city_products(
        out, list(account.blocks), print_status
    ):
        account = replace(account, over=snapshots)
        write_products_digest(out, account)
    return account, time.monotonic() - started


def _describe_block_outcome(outcome: BlockResult) -> str:
    if outcome.code in (0, 1):
        failed = f"; {outcome.reason}" if outcome.code else ""
        return (
            f"done in {outcome.seconds:.0f} s, {format_count(outcome.summary.get('facades_done', 0), 'facade')}{failed}"
        )
    return f"ended with {outcome.code} ({outcome.reason})"
