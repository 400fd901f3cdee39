"""The flow of a city: its blocks, one by one or some at a time, and what lies over all of them."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from datetime import datetime
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from prefect import Task, flow
from prefect.futures import PrefectFuture
from prefect.runtime import flow_run
from prefect.states import Completed, State
from prefect.task_runners import ThreadPoolTaskRunner

from catalogs.published.folders import Folder
from catalogs.published.s3 import folder_at
from flows.artifacts import tell_blocks
from flows.asked import Asked, ends_at
from flows.cli.console import tell
from flows.lock import locked, require_held
from flows.markdown import plain
from tasks.city.account import Account, Ended, known, write_ended, write_over_of, write_summary
from tasks.city.over import write_over
from tasks.city.running import TIME_IS_UP, run_block
from tasks.city.sources import version

# Blocks at a time at most.
MOST_AT_ONCE = 64

# Of the time a run spends at most so much on what lies over all blocks, which grows with them; it is written at the end anyway.
OVER_SHARE = 0.05

# Starts the run of a block; what it returns calls back when that has ended.
Submit = Callable[..., Any]


def flow_run_name() -> str:
    """The city and the date for which the run was scheduled."""
    return f"{Path(flow_run.parameters['city_file']).stem} {flow_run.scheduled_start_time:%Y-%m-%d %H:%M}"


@flow(
    name="city",
    description="Texture a city block by block. Resumes by itself; what did not change is not done again.",
    flow_run_name=flow_run_name,
    task_runner=ThreadPoolTaskRunner(max_workers=MOST_AT_ONCE),  # type: ignore[arg-type]
)
def city(
    city_file: Path,
    out: str | Path | None = None,
    workers: int = 2,
    dask: str | None = None,
    at_once: int = 1,
    until: str | None = None,
    keep: int | None = None,
    tiles: bool = True,
) -> dict[str, Any] | State:
    """Texture the city of `city_file` into `out`; resumes by itself. Returns the run's summary.

    Args:
        city_file: the city.
        out: folder for the results, or s3://bucket/prefix, each block a run in out/blocks/NAME; out/NAME of the city file where
            there is none.
        workers: local processes of each block.
        dask: address of a Dask scheduler to use instead, which all blocks share.
        at_once: blocks at a time.
        until: local time of day, such as 06:00, at which the run ends, done or not; what is committed stays. It is
            the next after the run was to begin: one that begins later, or is tried again then, begins no block.
        keep: published snapshots of each block to keep, the newest; all without.
        tiles: whether the 3D Tiles of each block are exported, to which out/tileset.json leads.
    """
    asked = Asked(workers, dask, at_once, until, keep, tiles)
    since = flow_run.scheduled_start_time.astimezone().replace(tzinfo=None)
    summary = _run(city_file, folder_at(out or Path("out") / city_file.stem), asked, since, _recorded, tell_blocks)
    if summary["failures"] or summary["left"]:
        said = f"{summary['blocks_done']} of {summary['blocks']} blocks are done; {len(summary['left'])} are left"
        failed = "; ".join(f"{one['unit']}: {one['reason']}" for one in summary["failures"][:3])
        return Completed(name="BlocksLeft", message=plain(f"{said}. {failed}"), data=summary)
    return summary


def unrecorded_city(city_file: Path, out: Folder, asked: Asked) -> dict[str, Any]:
    """What `city` does, without a Prefect server."""
    with ThreadPoolExecutor(MOST_AT_ONCE, thread_name_prefix="blocks") as pool:
        return _run(city_file, out, asked, datetime.now(), partial(_unrecorded, pool), lambda account: None)


def _recorded(task: Task, *arguments: Any) -> PrefectFuture:
    return task.submit(*arguments)


def _unrecorded(pool: ThreadPoolExecutor, task: Task, *arguments: Any) -> Future:
    return pool.submit(task.fn, *arguments)


def _run(
    city_file: Path, out: Folder, asked: Asked, since: datetime, submit: Submit, show: Callable[[Account], None]
) -> dict[str, Any]:
    begun = time.monotonic()
    ends = None if asked.until is None else ends_at(asked.until, since).timestamp()
    with locked(out):
        account, files = known(city_file, out)
        due = account.due(out, tiles=asked.tiles)
        estimate = account.estimate(due, asked.workers, asked.at_once)
        lasting = f", about {estimate['hours']:.2g} h" if due else ""
        tell(f"{len(account.blocks)} blocks, {len(due)} of them due{lasting}")
        ended: SimpleQueue[tuple[str, Any]] = SimpleQueue()
        waiting, running, over_at = deque(due), 0, 0.0
        while waiting or running:
            while waiting and running < asked.at_once and (ends is None or time.time() < ends):
                name = waiting.popleft()
                before, digest = account.blocks[name], account.digests[name]
                future = submit(
                    run_block, out, name, files[name], asked.of_a_block(), before, digest, version(), ends, asked.tiles
                )
                future.add_done_callback(lambda future, name=name: ended.put((name, future)))
                running += 1
            if not running:
                break
            name, future = ended.get()
            running -= 1
            how: Ended = future.result()
            account = account.ended(name, how)
            require_held(out)
            write_ended(out, name, how)
            tell(f"block {name}: {_said(how)}; {len(waiting) + running} to go")
            if time.monotonic() >= over_at:
                account, took = _over(out, account, show)
                over_at = time.monotonic() + took / OVER_SHARE
        account, _ = _over(out, account, show)
        left = [name for name in account.blocks if name in waiting or account.blocks[name].code == TIME_IS_UP]
        summary = account.summary(out) | {"blocks_skipped": len(account.blocks) - len(due), "left": left}
        summary["seconds"] = round(time.monotonic() - begun, 2)
        spent = sum(account.blocks[name].processor for name in due if name not in waiting) / 3600
        taken = {"hours_taken": summary["seconds"] / 3600, "processor_hours_taken": spent}
        summary["estimate"] = estimate | {name: float(f"{value:.3g}") for name, value in taken.items()}
        write_summary(out, summary)
    return summary


def _over(out: Folder, account: Account, show: Callable[[Account], None]) -> tuple[Account, float]:
    """Show how all blocks stand, and write what lies over them where it is not of what they published last. Says of what it is,
    and the seconds that took."""
    begun = time.monotonic()
    show(account)
    require_held(out)
    if account.over != (of := account.snapshots()) and write_over(out, list(account.blocks), tell):
        account = replace(account, over=of)
        write_over_of(out, account)
    return account, time.monotonic() - begun


def _said(ended: Ended) -> str:
    if ended.code in (0, 1):
        failed = f"; {ended.reason}" if ended.code else ""
        return f"done in {ended.seconds:.0f} s, {ended.summary.get('facades_done', 0)} facades{failed}"
    return f"ended with {ended.code} ({ended.reason})"
