"""What the Prefect UI shows of a run: progress while it goes on; its units, failures and links when it is done.

A server that does not take an artifact keeps less of the run; it does not end it.
"""

from __future__ import annotations

import logging
import re
import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread
from typing import Any, cast
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

from catalogs.published.folders import Folder
from catalogs.published.s3 import folder_at
from flows.markdown import escape_row, markdown_code, escape_markdown
from flows.viewer import VIEWER_HOST, VIEWER_PORT
from tasks.city.account import Account, Ended
from tasks.city.running import TIME_IS_UP
from tasks.engine.progress import add_listener
from tasks.engine.run import Run
from tasks.engine.store.commits import read_newest_journal
from tasks.stages.order import STAGE_NAMES, STAGES_IN_ORDER

log = logging.getLogger(__name__)

# Seconds between two updates of the progress shown.
REFRESH_S = 2.0
# Rows of the units' table at most, failed ones first; the catalogue has them all.
MAX_TABLE_ROWS = 1000
# States of a city's blocks in the order of their table; "done in part": published, with failed units; "left": its time was up.
BLOCK_STATES = ("failed", "done in part", "left", "due", "done")
# Columns of the facades' table; the catalogue has more.
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
# Every run goes through these, in equal shares of its progress: how many units one has is known when it begins.
STAGES_OF_EVERY_RUN = {"ingest", "publish"} | {kind.stage for kind in STAGES_IN_ORDER if kind.in_every_block}


@contextmanager
def _ignore_server_errors() -> Iterator[None]:
    """Leave out of the server's record what it does not take, and log that."""
    try:
        yield
    except Exception as error:  # whatever a client makes of a server that has ended, is full, or is not Prefect's
        log.warning("the Prefect server's record of this run is incomplete: %s", " ".join(str(error).split()))


@contextmanager
def track_progress(block: str) -> Iterator[None]:
    """Keep an artifact at the share of the work that is finished, until the block ends."""
    finished: dict[str, tuple[int, int]] = {}
    over = Event()
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
        told = 0.0
        # one client: each makes a TLS context, which costs as much as half a viewpoint
        with _ignore_server_errors(), get_client(sync_client=True) as client:
            while not over.wait(REFRESH_S):
                if (now := percent()) != told:
                    client.update_artifact(artifact, ArtifactUpdate(data=now))
                    told = now

    stop = add_listener(lambda told: finished.update({told.stage: (told.finished, told.total)}))
    thread = Thread(target=refresh, name="progress-artifact", daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        stop()
        thread.join()
    with _ignore_server_errors():
        update_progress_artifact(artifact, 100.0)


@_ignore_server_errors()
def publish_viewer_link(run: Run) -> None:
    """A link to where the viewer of a run answers once somebody starts it, which may be while the run goes on."""
    command = shlex.join(["streetloom", "view", run.out])
    create_link_artifact(
        f"http://{VIEWER_HOST}:{VIEWER_PORT}/",
        link_text=f"map, facades and 3D model of {escape_markdown(run.block)}",
        key=f"{_slug(run.block)}-viewer",
        description=f"{markdown_code(command)} on the run's machine serves it there, also while the run goes on",
    )


@_ignore_server_errors()
def publish_outcome(run: Run, summary: dict[str, Any]) -> None:
    """Artifacts of a finished run: tables of the units and of the facades, the failures with their reasons, links to what was
    published."""
    slug = _slug(run.block)
    # what ingest counts as, and what has no record in the journal since it was set aside before
    units: list[dict[str, Any]] = [
        {"stage": "ingest", "unit": run.block, "status": "done", "seconds": None, "worker": ""}
    ]
    units += [
        {
            "stage": stage,
            "unit": record["unit"],
            # done from another source than the one that was refused
            "status": "refused" if record["status"] == "done" and record.get("reason") else record["status"],
            "seconds": round(sum(record.get("seconds", {}).values()), 2),
            "worker": record.get("worker", ""),
        }
        for stage in STAGE_NAMES
        for record in read_newest_journal(run.store, stage)
        if record
    ]
    failures = summary["failures"]
    recorded = {row["unit"] for row in units if row["status"] in ("failed", "refused")}
    units += [
        {"stage": "ingest", "unit": failure["unit"], "status": "set aside", "seconds": None, "worker": ""}
        for failure in failures
        if failure["unit"] not in recorded
    ]
    units.sort(key=lambda row: row["status"] == "done")
    shown = f"{len(units)} units" if len(units) <= MAX_TABLE_ROWS else f"{MAX_TABLE_ROWS} of {len(units)} units, those not done first"
    counts = f"{summary['units_done']} done in this run, {summary['units_skipped']} before, {len(failures)} failed"
    create_table_artifact([*map(escape_row, units[:MAX_TABLE_ROWS])], key=f"{slug}-units", description=f"{shown}: {counts}")
    why = f"{describe_failures(summary)}, and why" if failures else "no unit failed or was set aside"
    create_table_artifact([*map(escape_row, failures)], key=f"{slug}-failures", description=why)
    outputs = summary["outputs"]
    facades = _read_facade_rows(folder_at(outputs["items"]))
    create_table_artifact(
        [*map(escape_row, facades[:MAX_TABLE_ROWS])],
        key=f"{slug}-facades",
        description=f"{len(facades)} facades, failed ones first; {markdown_code(f'streetloom query {run.out}')} finds what you look for",
    )
    report = folder_at(outputs["report"]).resolve()
    # browsers do not follow links from a server's page to files, so every path is also there to be copied
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
        f"{markdown_code(f'streetloom view {run.out}')} serves the map, every facade stage by stage and the block in 3D at "
        f"[{VIEWER_HOST}:{VIEWER_PORT}](http://{VIEWER_HOST}:{VIEWER_PORT}/), also while a run goes on; "
        f"{markdown_code(f'streetloom query {run.out}')} answers questions about the facades."
    )
    create_markdown_artifact(
        "\n".join([f"# {escape_markdown(run.block)}", "", *lines, "", find]),
        key=f"{slug}-outputs",
        description=f"{summary['facades_done']} facades and {summary['viewpoints']} viewpoints, in {escape_markdown(run.out)}",
    )


@_ignore_server_errors()
def publish_block_table(account: Account) -> None:
    """A table of a city's blocks as they stand now, those that want somebody or something first."""
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
    said = ", ".join(f"{count} {state}" for state, count in counts.items() if count)
    create_table_artifact(
        [*map(escape_row, rows[:MAX_TABLE_ROWS])], key=f"{_slug(account.name)}-blocks", description=f"{len(rows)} blocks: {said}"
    )


def _block_state(outcome: Ended) -> str:
    known = {None: "due", 0: "done", 1: "done in part", TIME_IS_UP: "left"}
    return known.get(outcome.code, "failed")


def _file_address(path: Folder) -> str:
    return path.as_uri() if isinstance(path, Path) else str(path)


def _read_facade_rows(items: Folder) -> list[dict[str, Any]]:
    """The facades of a published table with a few of their columns, failed ones first."""
    import pyarrow.parquet as pq
    from pyarrow import BufferReader

    table = BufferReader(items.read_bytes())
    held = pq.read_schema(table).names  # an earlier version published fewer
    shown = [name for name in FACADE_COLUMNS if name in held]
    table.seek(0)
    rows = pq.read_table(table, columns=["kind", *shown]).to_pylist()
    facades = [{name: row[name] for name in shown} for row in rows if row["kind"] == "facade"]
    return sorted(facades, key=lambda row: row["status"] == "done")


def describe_failures(summary: dict[str, Any]) -> str:
    """How many units failed or were set aside, in words."""
    count = len(summary["failures"])
    return f"{count} unit{'' if count == 1 else 's'} failed or set aside"


def _slug(name: str) -> str:
    """A name as Prefect wants keys of artifacts: lower case letters, digits and dashes."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-") or "block"
