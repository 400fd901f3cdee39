"""Diagnosis of a run's folder: publication, integrity and stale units. Writes nothing but `.suspect`."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import icechunk

from catalogs.block import Block
from catalogs.block.reader import read_block
from catalogs.printable_text import format_command, format_unit_reason
from catalogs.published.file_list import find_snapshot_damage
from catalogs.published.folders import Folder
from catalogs.published.runs import publish_hint
from catalogs.published.snapshot import find_current_snapshot
from catalogs.reader_errors import to_single_line
from facade_core.atlas.integrity import DAMAGE_ERRORS, find_broken_tags, find_unreadable_chunks, has_all_files
from facade_core.atlas.journal import Record
from facade_core.atlas.store import BRANCH, Repository, open_repository, open_root
from facade_core.core.errors import FacadeError, InputError, StoreError, StoreFormatError
from facade_core.core.zarr_types import StoreGroup
from facade_core.plan.plan_tables import read_plan
from tasks.doctor.findings import Finding
from tasks.engine.forecast import NOTHING_PENDING, forecast_work
from tasks.engine.run_key import create_run
from tasks.engine.stage import read_journals
from tasks.engine.store.carry_over import has_all_stages
from tasks.engine.store.digests import find_differing_units
from tasks.engine.store.integrity import find_lost_units, is_store_marked_suspect, mark_store_suspect
from tasks.engine.store.status import explain_unpublished, read_run_block_file
from tasks.stages.ingest.task import ingest_block

# Maximum number of charts and panoramas whose digests are verified.
MAX_VERIFIED_UNITS = 64
# Maximum number of inputs that were set aside and are named.
MAX_SET_ASIDE_LINES = 50


def examine_folder(out: Folder) -> Iterator[Finding]:
    """Yield the findings about a run's folder; no run may be at work in it."""
    source = read_run_block_file(out)
    again = f"`{format_command('run', source or 'BLOCK.yaml', '--out', out)}`"
    store = out / "store"
    if not store.is_dir():
        makes = publish_hint(out, "makes one") if source is None else f"{again} makes one"
        yield Finding("store", False, f"{out} holds no run; {makes}")
        return
    try:
        repository = open_repository(store)
        session = repository.readonly_session(BRANCH)
        group = open_root(session)
        records = read_journals(group)
        attrs = dict(group.attrs)
    except StoreFormatError as error:
        yield Finding("store", False, str(error))
        yield from _check_published(out, None, again)
        return
    except (StoreError, *DAMAGE_ERRORS) as error:
        line = str(error).strip().splitlines()[0].strip(" x")
        yield Finding("store", False, f"the newest snapshot cannot be read ({line}); {again} goes back to one that can")
        yield from _check_published(out, None, again)
        return
    yield _check_units(attrs, records, again)
    yield from _list_input_notes(attrs)
    store_findings = list(_check_store(out, repository, session, group, again))
    yield from store_findings
    yield from _check_published(out, session.snapshot_id, again)
    if all(finding.is_well is not False for finding in store_findings):
        yield _check_stale(out, source, group)


def _check_units(attrs: Mapping[str, object], records: dict[str, list[Record | None]], again: str) -> Finding:
    states = Counter(r["status"] if r else "waiting" for journal in records.values() for r in journal)
    counts = ", ".join(f"{states[state]} {state}" for state in ("done", "failed", "stale", "waiting") if states[state])
    left = sum(states.values()) - states["done"]
    return Finding("units", not left, f"block {attrs.get('block')}: {counts}{f'; {again} continues' if left else ''}")


def _list_input_notes(attrs: Mapping[str, Any]) -> Iterator[Finding]:
    """List the notes of the last ingest on the block's inputs, and the inputs that it set aside."""
    for note in attrs.get("notes", ()):
        yield Finding("inputs", None, to_single_line(str(note)))
    set_aside = attrs.get("set_aside", ())
    for kind, unit, reason in set_aside[:MAX_SET_ASIDE_LINES]:
        yield Finding("inputs", None, to_single_line(f"{kind} set aside: {format_unit_reason(unit, reason)}"))
    if len(set_aside) > MAX_SET_ASIDE_LINES:
        rest = len(set_aside) - MAX_SET_ASIDE_LINES
        yield Finding("inputs", None, f"{rest} more set aside; the report lists them")


def _check_store(
    out: Folder, repository: Repository, session: icechunk.Session, group: StoreGroup, again: str
) -> Iterator[Finding]:
    """Compare records with arrays: sizes and listings, then every chunk, then a sample of digests."""
    store = out / "store"
    remedy = f"{again} repairs this"
    if not has_all_stages(group):
        yield Finding("store", False, f"tables of the plan are missing; {remedy}")
        return
    if tags := find_broken_tags(repository, store):
        yield Finding("store", False, f"{len(tags)} tags cannot be read; {again} removes them")
    if lost := find_unreadable_chunks(session):
        if has_all_files(repository, store):
            mark_store_suspect(out)
        count = sum(len(chunks) if chunks else 1 for chunks in lost.values())
        yield Finding("store", False, f"{count} chunks of {', '.join(sorted(lost)[:3])} cannot be read; {remedy}")
        return
    if lost_units := find_lost_units(session):
        summary = ", ".join(f"{len(units)} {stage}" for stage, units in lost_units.items())
        yield Finding("store", False, f"records without their data: {summary}; {remedy}")
    plan = read_plan(session)
    if wrong := find_differing_units(group, plan, MAX_VERIFIED_UNITS):
        mark_store_suspect(out)
        summary = ", ".join(f"{len(units)} {stage}" for stage, units in wrong.items())
        yield Finding("store", False, f"texels differ from the digests of their records: {summary}; {remedy}")
    elif not lost_units:
        yield Finding(
            "store",
            True,
            f"all chunks can be read; the digests of up to {MAX_VERIFIED_UNITS} charts and panoramas match",
        )
    if is_store_marked_suspect(out):
        yield Finding("store", None, "the next run verifies the whole store before it starts")


def _check_published(out: Folder, newest: str | None, again: str) -> Iterator[Finding]:
    current = find_current_snapshot(out)
    there = out / "published"
    folders = sorted(path.name for path in there.iterdir() if path.is_dir()) if there.is_dir() else []
    leftovers = [name for name in folders if name.startswith(".")]
    if current is None:
        yield Finding("published", False, f"`current` names no existing snapshot; {again} publishes")
    elif fault := find_snapshot_damage(current.folder, thorough=True):
        if not find_snapshot_damage(current.folder):  # no size shows it: the next run compares digests
            mark_store_suspect(out)
        yield Finding("published", False, f"{current.id}: {fault}; {again} publishes it again")
    elif newest is not None and (fault := explain_unpublished(out, newest)):
        yield Finding(
            "published", False, f"{current.id} is complete; the newest snapshot is {newest}: {fault}; {again} continues"
        )
    else:
        yield Finding("published", True, f"{current.id} is complete; {len(folders) - len(leftovers) - 1} older ones")
    if leftovers:
        yield Finding(
            "published",
            None,
            f"{len(leftovers)} leftovers of killed runs; `{format_command('prune', out, '--keep', 'N')}` removes them",
        )


def _check_stale(out: Folder, source: Path | None, group: StoreGroup) -> Finding:
    """Forecast the work of a run with the present block file, on a copy."""
    if source is None:
        return Finding("stale", None, "the folder does not name its block file; the next run records it")
    again = f"`{format_command('run', source, '--out', out)}`"
    if not isinstance(out, Path):
        return Finding(
            "stale", None, f"not checked for a run in a bucket; {again} lists the pending units and processes them"
        )
    try:
        block = read_block(source)
        said = forecast_changes(block, out)
    except (FacadeError, OSError) as error:
        return Finding("stale", False, f"{source}: {' '.join(str(error).split())}")
    if group.attrs.get("key") == create_run(block, out).key and (said is None or said == NOTHING_PENDING):
        return Finding("stale", True, f"nothing; {source} and the code are unchanged")
    # stale is no damage: the data match an earlier block or code
    return Finding("stale", None, f"{said or 'everything is pending'}; the next run processes it: {again}")


def forecast_changes(block: Block, out: Path) -> str | None:
    """Return one line on what a run of a block would do again in its folder; None without an earlier run.

    The forecast is made on a copy of the store.

    Raises
    ------
    InputError
        If the folder holds another block.
    """
    run = create_run(block, out)
    held = open_root(open_repository(out / "store").readonly_session(BRANCH)).attrs.get("block")
    if held != run.block:
        raise InputError(f"{out}: the block file is block {run.block}; the folder holds {held}")
    with _writable_copy(out) as copy:
        trial = replace(run, out=str(copy))
        outline = ingest_block.fn(trial, block)
        return forecast_work(replace(trial, ingested=outline.ingested), block, outline).said


@contextmanager
def _writable_copy(out: Path) -> Iterator[Path]:
    """Copy a store by hard links, which is safe because Icechunk never rewrites a file."""
    try:
        folder = Path(tempfile.mkdtemp(prefix=".doctor-", suffix=".tmp", dir=out))
    except OSError:  # the folder is read-only
        folder = Path(tempfile.mkdtemp())
    linked = folder.parent == out
    try:
        shutil.copytree(out / "store", folder / "store", copy_function=os.link if linked else shutil.copy2)
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
