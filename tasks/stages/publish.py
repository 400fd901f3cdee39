"""Publish a snapshot: model, pictures, report and items, then point `current` at it."""

from __future__ import annotations

import logging
import os
import shutil
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import icechunk
from prefect import task
from prefect.cache_policies import NO_CACHE

from catalogs.published.files import amiss, predecessor_of, write_files
from catalogs.published.items import write_items
from catalogs.published.snapshot import Snapshot, current_if_any, make_current, snapshot_in
from catalogs.stac.catalog import write_catalog
from catalogs.stac.snapshot import write_stac
from facade_core.atlas.store import BRANCH, commit, expire, open_repository, open_root
from facade_core.export import write_glb
from tasks.keys.stage_code import stage_code
from tasks.progress import advance, begin_stage
from tasks.published.catalogue_facts import block_facts, models_used, run_facts, street_facts
from tasks.published.images import aim_views, write_images
from tasks.published.limit import over_limit
from tasks.published.pages import write_pages
from tasks.published.report import write_block_report
from tasks.published.rows import rows_of, write_masked, write_summary
from tasks.published.stored import stored_block
from tasks.run import Run
from tasks.store.commits import standing_tags

log = logging.getLogger(__name__)


@task(name="publish", task_run_name="publish", cache_policy=NO_CACHE)
def publish_block(run: Run, block_file: Path | None = None) -> dict[str, Any]:
    """Write published/<snapshot>/ from the newest snapshot, unless `current` already points at it, whole.

    Where too many units failed, `current` stays, and so does the snapshot that it names; the summary says so as `withheld`.

    block_file: what the block was read from: the catalogue names its sources. The snapshot published before is linked as the
    earlier version.
    """
    _stand_by_code(run)
    session = open_repository(run.store).readonly_session(BRANCH)
    out = Path(run.out)
    final, last = snapshot_in(out, session.snapshot_id), current_if_any(out)
    begin_stage("publish", 1)
    if last != final or amiss(final.folder):
        predecessor = predecessor_of(final.folder) if last == final else last.id if last else None
        temporary = Snapshot(_hidden(final, "tmp"))
        temporary.folder.mkdir(parents=True)
        _write(run, session, temporary, block_file, predecessor)
        _put_in_place(temporary, final)
        if withheld := over_limit(run, open_root(session)):
            advance("publish", 1)
            return final.outcome() | {"withheld": f"{withheld}; look at {final.report / 'index.html'}"}
        make_current(final)
        _forget_history(run, last)
    write_catalog(out)  # also where a run ended between the two
    advance("publish", 1)
    return final.outcome()


def _put_in_place(written: Snapshot[Path], final: Snapshot[Path]) -> None:
    """Give what was written its name; what has that name is damaged."""
    damaged = _hidden(final, "damaged.tmp")
    if final.folder.exists():
        os.replace(final.folder, damaged)
    os.replace(written.folder, final.folder)
    shutil.rmtree(damaged, ignore_errors=True)


def _hidden(snapshot: Snapshot[Path], suffix: str) -> Path:
    """A folder beside a snapshot's that no reader looks into, and that is not there yet."""
    folder = snapshot.folder.with_name(f".{snapshot.id}.{suffix}")
    shutil.rmtree(folder, ignore_errors=True)
    return folder


def _stand_by_code(run: Run) -> None:
    """Have the store say which code publishes it: by another the same texels are another snapshot, in a folder of its own."""
    session = open_repository(run.store).writable_session(BRANCH)
    root = open_root(session)
    if root.attrs.get("published_by") != stage_code("publish"):
        root.attrs["published_by"] = stage_code("publish")
        commit(session, "published by other code")


def _forget_history(run: Run, last: Snapshot[Path] | None) -> None:
    """Expire what no unit needs any more: none is under way, and street ends are tagged. Where somebody still reads what was
    published last, it is left to the next run."""
    try:
        with last.alone() if last else nullcontext(True) as nobody:
            if nobody:
                expire(open_repository(run.store))
    except icechunk.IcechunkError as error:  # an earlier snapshot is damaged: what is published does not depend on it
        log.warning("%s: its history is kept, which cannot be read (%s)", run.store, str(error).splitlines()[0])


def _write(
    run: Run, session: icechunk.Session, snapshot: Snapshot[Path], block_file: Path | None, predecessor: str | None
) -> None:
    """Everything that is published of a session's snapshot, each file or folder in a step of its own."""
    block = stored_block(session)
    views = aim_views(block)
    pages = write_pages(snapshot, block, views.values())
    write_glb(snapshot.model, block.plan.scene, pages, block.names)
    images = write_images(snapshot.report / "images", block, views)
    rows = rows_of(run, block)
    write_items(snapshot.items, rows.every, run.crs)
    write_masked(snapshot.masked, block.records)
    summary = write_summary(snapshot.summary, block, rows)
    write_block_report(snapshot.report, run, block, rows, summary, images)
    work = run_facts(block.journals, block.ingested)
    write_stac(
        snapshot.folder,
        rows=rows.every,
        block=block_facts(run, block, session.snapshot_id, rows, work.ended, block_file),
        streets=street_facts(block.plan, block.journals["streets"], block.journals["viewpoints"]),
        run=work,
        models=models_used(run, block.records, block.journals["viewpoints"]),
        predecessor=predecessor,
    )
    write_files(snapshot.folder, predecessor, standing_tags(block.group))
