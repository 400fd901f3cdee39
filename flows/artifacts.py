"""Artifacts of a run in the Prefect UI: progress, then tables of units, failures and links.

A server that rejects an artifact loses that part of the record; the run continues.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from functools import partial
from pathlib import Path
from threading import Event, Thread
from typing import cast
from uuid import UUID

from prefect.artifacts import (
    create_link_artifact,
    create_markdown_artifact,
    create_progress_artifact,
    create_table_artifact,
    update_progress_artifact,
)
from prefect.client.orchestration import get_client
from prefect.client.schemas.actions import ArtifactUpdate

from catalogs.printable_text import format_command, format_count
from catalogs.published.folders import Folder
from catalogs.published.s3 import folder_at
from facade_core.core.json_types import JsonObject
from flows.log_file import forward_log_to_prefect
from flows.markdown import escape_markdown, escape_row, markdown_code
from flows.run_entry import HeldRun
from flows.submission import is_recorded
from flows.viewer import VIEWER_HOST, VIEWER_PORT
from tasks.city.city_log import BlockResult, CityLog
from tasks.engine.commands import DEADLINE_EXIT_CODE
from tasks.engine.progress import add_listener
from tasks.engine.run import Run
from tasks.engine.store.commits import read_newest_journal
from tasks.stages.order import (
    EXEMPLARS,
    FACADES,
    PAGES,
    PICTURES,
    STAGE_NAMES,
    STREETS,
    SURFACES,
    TILES,
)

log = logging.getLogger(__name__)

# Interval between updates of the progress artifact, seconds.
REFRESH_S = 2.0
# Rows of a table, failed ones first; the catalogue has all.
MAX_TABLE_ROWS = 1000
# States of a city's blocks in the order of their table. "done in part": published with failed units; "left": out of time.
BLOCK_STATES = ("failed", "done in part", "left", "due", "done")
# Columns of the facade table; the catalogue has more.
FACADE_COLUMNS = (
    "id",
    "street",
    "role",
    "status",
    "reason",
    "quality",
    "floors",
    "windows",
    "occluded",
    "photo",
    "layout_score",
)
# Stages with equal shares of the progress: the number of units of a stage is known only when it begins.
STAGES_OF_EVERY_RUN = {
    "ingest",
    *(one.stage for one in (EXEMPLARS, FACADES, STREETS, SURFACES, PAGES, TILES, PICTURES)),
    "publish",
}


@contextmanager
def _ignore_server_errors() -> Iterator[None]:
    """Log errors of the Prefect server instead of raising them."""
    try:
        yield
    except Exception as error:  # clients raise many types where a server has ended, is full, or is not Prefect
        log.warning("the Prefect server's record of this run is incomplete: %s", " ".join(str(error).split()))


@contextmanager
def record_block(entry: HeldRun) -> Iterator[Callable[[JsonObject], None]]:
    """Record the run of a block in Prefect: its log, progress and links; yields a function that records its outcome.

    Outside a flow run there is no record.
    """
    if not is_recorded():
        yield lambda summary: None
        return
    with forward_log_to_prefect():
        publish_viewer_link(entry.run)
        with nullcontext() if entry.summary is not None else track_progress(entry.block.name):
            yield partial(publish_outcome, entry.run)


@contextmanager
def track_progress(block: str) -> Iterator[None]:
    """Keep a progress artifact at the share of finished work until the block ends."""
    finished: dict[str, tuple[int, int]] = {}
    ended = Event()
    key = f"{_slug(block)}-progress"
    artifact: UUID | None = None
    with _ignore_server_errors():
        artifact = cast(
            UUID, create_progress_artifact(0.0, key=key, description="percent of the work that is finished")
        )
    if artifact is None:
        yield
        return

    def percent() -> float:
        shares = [done / total if total else 1.0 for done, total in list(finished.values())]
        return round(100 * sum(shares) / len(STAGES_OF_EVERY_RUN | finished.keys()), 1)

    def refresh() -> None:
        reported = 0.0
        # one client: creating its TLS context costs as much as half a viewpoint
        with _ignore_server_errors(), get_client(sync_client=True) as client:
            while not ended.wait(REFRESH_S):
                if (now := percent()) != reported:
                    client.update_artifact(artifact, ArtifactUpdate(data=now))
                    reported = now

    stop = add_listener(lambda event: finished.update({event.stage: (event.finished, event.total)}))
    thread = Thread(target=refresh, name="progress-artifact", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        stop()
        thread.join()
    with _ignore_server_errors():
        update_progress_artifact(artifact, 100.0)


@_ignore_server_errors()
def publish_viewer_link(run: Run) -> None:
    """Create a link to the address of the run's viewer, which may be started while the run is in progress."""
    command = format_command("view", run.out)
    create_link_artifact(
        f"http://{VIEWER_HOST}:{VIEWER_PORT}/",
        link_text=f"map, facades and 3D model of {escape_markdown(run.block)}",
        key=f"{_slug(run.block)}-viewer",
        description=f"{markdown_code(command)} on the run's machine serves it there, also while the run goes on",
    )


@_ignore_server_errors()
def publish_outcome(run: Run, summary: JsonObject) -> None:
    """Create the artifacts of a finished run: tables of units and facades, failures with reasons, links to products."""
    slug = _slug(run.block)
    # ingest has no journal record
    units: list[dict[str, object]] = [
        {"stage": "ingest", "unit": run.block, "status": "done", "seconds": None, "worker": ""}
    ]
    units += [
        {
            "stage": stage,
            "unit": record["unit"],
            # the unit was done from another source after its first was refused
            "status": "refused" if record["status"] == "done" and record.get("reason") else record["status"],
            "seconds": round(sum(record.get("seconds", {}).values()), 2),
            "worker": record.get("worker", ""),
        }
        for stage in STAGE_NAMES
        for record in read_newest_journal(run.store, stage)
        if record
    ]
    failures, refused = summary["failures"], summary["refused"]
    recorded = {(row["unit"], row["status"]) for row in units}
    units += [
        {"stage": "ingest", "unit": one["unit"], "status": status, "seconds": None, "worker": ""}
        for status, found in (("failed", failures), ("refused", refused))
        for one in found
        if (one["unit"], status) not in recorded
    ]
    units.sort(key=lambda row: row["status"] == "done")
    caption = (
        format_count(len(units), "unit")
        if len(units) <= MAX_TABLE_ROWS
        else f"{MAX_TABLE_ROWS} of {len(units)} units, those not done first"
    )
    counts = f"{summary['units_done']} done in this run, {summary['units_skipped']} before"
    counts += f", {len(failures)} failed, {len(refused)} refused"
    create_table_artifact(
        [*map(escape_row, units[:MAX_TABLE_ROWS])], key=f"{slug}-units", description=f"{caption}: {counts}"
    )
    create_table_artifact(
        [*map(escape_row, failures + refused)],
        key=f"{slug}-failures",
        description=f"{describe_failure_count(summary)}, {len(refused)} refused, and why",
    )
    outputs = summary["outputs"]
    facades = _read_facade_rows(folder_at(outputs["items"]))
    create_table_artifact(
        [*map(escape_row, facades[:MAX_TABLE_ROWS])],
        key=f"{slug}-facades",
        description=f"{format_count(len(facades), 'facade')}, failed ones first; "
        f"{markdown_code(format_command('query', run.out))} finds what you look for",
    )
    report = folder_at(outputs["report"]).resolve()
    # browsers do not follow links from a server's page to files, so each path can also be copied
    create_link_artifact(
        _file_address(report),
        link_text=f"report of {escape_markdown(run.block)}",
        key=f"{slug}-report",
        description=f"pictures and figures of every facade: open {escape_markdown(str(report))}",
    )
    links = [("report", outputs["report"]), *(("model", path) for path in outputs["glb"]), ("items", outputs["items"])]
    files = [(name, folder_at(path).resolve()) for name, path in links]
    lines = [f"- [{name}]({_file_address(path)}): {markdown_code(str(path))}" for name, path in files]
    find = (
        f"{markdown_code(format_command('view', run.out))} serves the map, every facade stage by stage and the block in 3D at "
        f"[{VIEWER_HOST}:{VIEWER_PORT}](http://{VIEWER_HOST}:{VIEWER_PORT}/), also while a run goes on; "
        f"{markdown_code(format_command('query', run.out))} answers questions about the facades."
    )
    create_markdown_artifact(
        "\n".join([f"# {escape_markdown(run.block)}", "", *lines, "", find]),
        key=f"{slug}-outputs",
        description=f"{format_count(summary['facades_done'], 'facade')}, in {escape_markdown(run.out)}",
    )


@_ignore_server_errors()
def publish_block_table(account: CityLog) -> None:
    """Create a table of the current state of a city's blocks, failed and pending ones first."""
    rows = [
        {
            "block": name,
            "state": _block_state(ended),
            "facades": ended.summary.get("facades_done"),
            "failed": ended.summary.get("facades_failed"),
            "viewpoints": ended.summary.get("viewpoints"),
            "minutes": round(ended.seconds / 60, 1),
            "reason": ended.reason,
        }
        for name, ended in account.blocks.items()
    ]
    rows.sort(key=lambda row: BLOCK_STATES.index(row["state"]))
    counts = {state: sum(row["state"] == state for row in rows) for state in BLOCK_STATES}
    caption = ", ".join(f"{count} {state}" for state, count in counts.items() if count)
    create_table_artifact(
        [*map(escape_row, rows[:MAX_TABLE_ROWS])],
        key=f"{_slug(account.name)}-blocks",
        description=f"{format_count(len(rows), 'block')}: {caption}",
    )


def _block_state(outcome: BlockResult) -> str:
    names = {None: "due", 0: "done", 1: "done in part", DEADLINE_EXIT_CODE: "left"}
    return names.get(outcome.code, "failed")


def _file_address(path: Folder) -> str:
    return path.as_uri() if isinstance(path, Path) else str(path)


def _read_facade_rows(items: Folder) -> list[dict[str, object]]:
    """Load the facades of a published table with a few of their columns, failed ones first."""
    import pyarrow.parquet as pq
    from pyarrow import BufferReader

    table = BufferReader(items.read_bytes())
    rows = pq.read_table(table, columns=["kind", *FACADE_COLUMNS]).to_pylist()
    facades = [{name: row[name] for name in FACADE_COLUMNS} for row in rows if row["kind"] == "facade"]
    return sorted(facades, key=lambda row: row["status"] == "done")


def describe_failure_count(summary: JsonObject) -> str:
    """Return the number of failed units in words."""
    return f"{format_count(len(summary['failures']), 'unit')} failed"


def _slug(name: str) -> str:
    """Return a name as a Prefect artifact key: lower case letters, digits and dashes."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-") or "block"
