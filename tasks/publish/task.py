"""Task of `publish`: write tables, pages, tiles, models, report and catalogue of a snapshot, then update `current`."""

from __future__ import annotations

import logging
import os
import shutil
from contextlib import nullcontext
from datetime import timedelta
from pathlib import Path

import icechunk
from prefect import task
from prefect.cache_policies import NO_CACHE

from catalogs.block.sources import block_data_sources
from catalogs.published.file_list import find_snapshot_damage, read_predecessor, write_file_list
from catalogs.published.folders import Folder, local_run_folder
from catalogs.published.items import write_items
from catalogs.published.reuse import SnapshotFileWriter
from catalogs.published.s3 import S3Path
from catalogs.published.snapshot import (
    SnapshotFolder,
    current_pointer_etag,
    find_current_snapshot,
    set_current_snapshot,
    snapshot_folder,
)
from catalogs.published.upload import upload_snapshot
from catalogs.stac.catalog import write_catalog
from catalogs.stac.facts import SnapshotFacts
from catalogs.stac.snapshot import write_stac
from facade_core.atlas.store import BRANCH, commit, expire_snapshots, open_repository, open_root
from facade_core.core.json_types import JsonObject
from tasks.engine.progress import begin_stage, report_progress
from tasks.engine.run import Run
from tasks.engine.stage_code import stage_code_digest
from tasks.engine.store.integrity import mark_store_suspect
from tasks.publish.attribution import build_attribution
from tasks.publish.catalogue_facts import block_facts, models_used, run_facts, street_facts
from tasks.publish.failure_limit import failure_limit_reason
from tasks.publish.images import ReportImages, write_report_images
from tasks.publish.item_rows import build_item_rows, write_masked_regions, write_summary
from tasks.publish.pages import write_atlas_pages
from tasks.publish.partial_failures import PartialFailures
from tasks.publish.prune import READER_GRACE
from tasks.publish.report import write_block_report
from tasks.publish.stored_block import read_stored_block
from tasks.publish.tiles import (
    WrittenTile,
    write_block_model,
    write_overview_model,
    write_surroundings_model,
    write_tiles,
)

log = logging.getLogger(__name__)

# Tables, pages, tiles, models, pictures, report, catalogue, list of files.
STEP_COUNT = 8


@task(name="publish", task_run_name="publish", cache_policy=NO_CACHE)
def publish_block(run: Run, block_file: Path | None = None) -> JsonObject:
    """Write published/<snapshot>/ from the newest snapshot, unless it is current and complete.

    If too many units failed, `current` stays, and the summary contains `withheld`. The summary lists unpublished parts
    with their reasons as `unpublished`; the next run tries them again. Files equal to those of the previous snapshot
    are linked.

    Parameters
    ----------
    run : run of the block.
    block_file : file of the block; the catalogue names its sources.
    """
    _record_publishing_code(run)
    session = open_repository(run.store).readonly_session(BRANCH)
    out = run.folder
    final, previous_tag, last = (
        snapshot_folder(out, session.snapshot_id),
        current_pointer_etag(out),
        find_current_snapshot(out),
    )
    begin_stage("publish", STEP_COUNT)
    failures = PartialFailures()
    if last != final or find_snapshot_damage(final.folder, thorough=True):
        predecessor = read_predecessor(final.folder) if last == final else last.id if last else None
        temporary = _hidden_folder(snapshot_folder(local_run_folder(out), final.id), "tmp")
        temporary.mkdir(parents=True)
        files = SnapshotFileWriter(temporary, last.folder if last else None)
        failures = _write_snapshot(run, session, files, block_file, predecessor, final.folder.parent)
        if failures.is_store_suspect:
            mark_store_suspect(out)
        _install(temporary, final.folder, files)
        if withheld := failure_limit_reason(run, open_root(session)):
            report_progress("publish", 1)
            return final.read_run_summary() | {"withheld": f"{withheld}; look at {final.report / 'index.html'}"}
        set_current_snapshot(final, previous_tag)
        _expire_history(run, last)
        report_progress("publish", 1)
    else:
        report_progress("publish", STEP_COUNT)
    with failures.attempt("catalog.json"):
        write_catalog(out)  # also after a run that ended between both steps
    unpublished = [{"unit": what, "reason": why} for what, why in failures.reasons.items()]
    return final.read_run_summary() | ({"unpublished": unpublished} if unpublished else {})


def _install(written: Path, final: Folder, files: SnapshotFileWriter) -> None:
    """Move the written folder to its final name, or upload it; a damaged one is replaced."""
    if isinstance(final, S3Path):
        upload_snapshot(written, final, files.earlier if isinstance(files.earlier, S3Path) else None, files.linked)
        shutil.rmtree(written)
        return
    damaged = _hidden_folder(SnapshotFolder(final), "damaged.tmp")
    if final.exists():
        os.replace(final, damaged)
    os.replace(written, final)
    shutil.rmtree(damaged, ignore_errors=True)


def _hidden_folder(snapshot: SnapshotFolder[Path], suffix: str) -> Path:
    """Return a free sibling folder of a snapshot that readers ignore."""
    folder = snapshot.folder.with_name(f".{snapshot.id}.{suffix}")
    shutil.rmtree(folder, ignore_errors=True)
    return folder


def _record_publishing_code(run: Run) -> None:
    """Record in the store which code publishes it: other code publishes the same texels as another snapshot."""
    session = open_repository(run.store).writable_session(BRANCH)
    root = open_root(session)
    if root.attrs.get("published_by") != stage_code_digest("publish"):
        root.attrs["published_by"] = stage_code_digest("publish")
        commit(session, "published by other code")


def _expire_history(run: Run, last: SnapshotFolder[Folder] | None) -> None:
    """Expire history that no unit needs; left to the next run while somebody reads the previous snapshot."""
    try:
        with last.lock_exclusively() if last else nullcontext(True) as nobody:
            if nobody:
                expire_snapshots(
                    open_repository(run.store), READER_GRACE if isinstance(run.folder, S3Path) else timedelta()
                )
    except icechunk.IcechunkError as error:  # the published snapshot does not depend on damaged earlier ones
        log.warning("%s: its history is kept, which cannot be read (%s)", run.store, str(error).splitlines()[0])


def _write_snapshot(
    run: Run,
    session: icechunk.Session,
    files: SnapshotFileWriter,
    block_file: Path | None,
    predecessor: str | None,
    published: Folder,
) -> PartialFailures:
    """Write all parts of a snapshot; returns the parts that failed.

    Tables come first and must succeed; any other part may fail alone. One file is held in memory at a time.
    """
    snapshot, failures = SnapshotFolder(files.folder), PartialFailures()
    block = read_stored_block(session)
    rows = build_item_rows(run, block)
    write_items(snapshot.items, rows.every, run.crs)
    write_masked_regions(snapshot.mask_file, block.records)
    summary = write_summary(snapshot.summary, block, rows)
    report_progress("publish", 1)
    with failures.attempt("pages"):
        write_atlas_pages(snapshot, block, files, failures)
    report_progress("publish", 1)
    sources = block_data_sources(block_file) if block_file else ()
    attribution = build_attribution(sources)
    tiles: list[WrittenTile] = []
    with failures.attempt("tiles"):
        tiles = write_tiles(snapshot, block, files, failures, attribution)
    report_progress("publish", 1)
    with failures.attempt("block.glb"):
        if not write_block_model(snapshot, block, tiles, files, attribution):
            log.info("block.glb would be too large: the block is in tiles/ and overview.glb")
    with failures.attempt("surroundings.glb"):
        write_surroundings_model(snapshot, block, files, attribution)
    with failures.attempt("overview.glb"):
        write_overview_model(snapshot, block, tiles, files, failures, attribution)
    report_progress("publish", 1)
    snapshot.report.mkdir(exist_ok=True)
    images = ReportImages((), {}, frozenset(), {}, {})
    with failures.attempt("pictures"):
        images = write_report_images(snapshot, block, files, failures)
    report_progress("publish", 1)
    with failures.attempt("report"):
        write_block_report(snapshot, run, block, rows, summary, images)
    report_progress("publish", 1)
    with failures.attempt("stac"):
        work = run_facts(block.records_by_stage, block.ingest_time)
        write_stac(
            snapshot.folder,
            rows=rows.every,
            facts=SnapshotFacts(
                block=block_facts(run, block, session.snapshot_id, rows, work.ended, sources),
                streets=street_facts(block.plan, block.journals["streets"]),
                run=work,
                models=models_used(run, block.records),
            ),
            predecessor=predecessor,
            published=published,
        )
    report_progress("publish", 1)
    write_file_list(
        snapshot.folder,
        predecessor,
        source_digests=files.source_digests,
        known=files.linked,
        failures=failures.reasons,
    )
    return failures
