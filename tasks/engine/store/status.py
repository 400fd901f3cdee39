"""Status of a run, read from the store alone: a finished run is answered without server and cluster."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from catalogs.printable_text import format_command
from catalogs.published.file_list import find_snapshot_damage
from catalogs.published.folders import Folder
from catalogs.published.runs import CITY_FILE_NAME
from catalogs.published.snapshot import find_current_snapshot, snapshot_folder
from catalogs.stac.catalog import CATALOG
from facade_core.atlas.integrity import DAMAGE_ERRORS, has_all_files
from facade_core.atlas.journal import Record
from facade_core.atlas.store import BRANCH, open_repository, open_root
from facade_core.core.errors import InputError, StoreError
from facade_core.core.json_types import JsonObject
from facade_core.core.zarr_types import StoreGroup
from tasks.engine.inputs import CODE, split_key
from tasks.engine.outcome import count_set_aside, list_reasons
from tasks.engine.run import Run
from tasks.engine.stage import all_stages, read_journals
from tasks.engine.stage_code import join_code_versions, stage_code_digest
from tasks.engine.store.carry_over import has_all_stages
from tasks.engine.store.integrity import find_lost_units, is_store_marked_suspect

# In a run's folder: the path of its block file, from there where it lies within.
SOURCE = "source"


def explain_unpublished(out: Folder, snapshot: str) -> str | None:
    """Return why a snapshot is not complete and current; None if it is."""
    found = find_current_snapshot(out)
    if found is None or found.id != snapshot:
        return "it is not published yet"
    if fault := find_snapshot_damage(found.folder):
        return f"published/{snapshot}: {fault}"
    try:
        json.loads((out / CATALOG).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return f"{CATALOG} is missing or cut"
    return None


def record_run_block_file(out: Folder, source: Path) -> None:
    """Record the block file of a run in its folder.

    A file within the folder, or within its city's, is recorded relative to it, so that a copy of the folder stays valid.
    """
    noted = source
    if isinstance(out, Path):
        city = out.parent.parent
        if source.is_relative_to(out) or (source.is_relative_to(city) and (city / CITY_FILE_NAME).is_file()):
            noted = Path(os.path.relpath(source, out))
    if _read_source(out) != noted:
        (out / SOURCE).write_text(f"{noted}\n")


def read_run_block_file(out: Folder) -> Path | None:
    """Read the block file of the last run in a folder; None if it is not recorded."""
    noted = _read_source(out)
    if noted is None or not isinstance(out, Path):
        return noted
    return Path(os.path.normpath(out / noted))


def _read_source(out: Folder) -> Path | None:
    try:
        return Path((out / SOURCE).read_text().strip())
    except (OSError, ValueError):
        return None


def completion_summary(run: Run) -> JsonObject | None:
    """Return the summary of a run whose units are all done and published; None if work is left.

    The run's key covers everything that unit keys digest besides the code of their stages.

    Raises
    ------
    InputError : the store is another block's.
    """
    if not run.store.is_dir():
        return None
    try:
        repository = open_repository(run.store)
        session = repository.readonly_session(BRANCH)
        group = open_root(session)
        _check_block(run, group)
        if group.attrs.get("key") != run.key or explain_unpublished(run.folder, session.snapshot_id):
            return None
        if group.attrs.get("published_by") != stage_code_digest("publish") or not has_all_stages(group):
            return None
        journals = read_journals(group)
        for stage, codes in _recorded_codes(journals).items():
            if codes != [stage_code_digest(stage)]:
                return None
        records = [record for journal in journals.values() for record in journal]
        if not all(record and record["status"] == "done" for record in records):
            return None
        if is_store_marked_suspect(run.folder) or find_lost_units(session) or not has_all_files(repository, run.store):
            return None
    except (StoreError, *DAMAGE_ERRORS):
        return None
    summary = snapshot_folder(run.folder, session.snapshot_id).read_run_summary()
    outcome = count_set_aside(group.attrs["set_aside"]).add(filter(None, records))
    return summary | {
        "out": run.out,
        "units_skipped": len(records) + 1,
        "units_done": 0,
        "failures": list_reasons(outcome.failed),
        "refused": list_reasons(outcome.refused),
    }


def store_code_version(group: StoreGroup) -> str:
    """Return the version of the code that made the contents of a store, and that publishes it."""
    codes = _recorded_codes(read_journals(group))
    return join_code_versions(
        {
            "ingest": str(group.attrs.get("ingested_by")),
            "publish": str(group.attrs.get("published_by")),
            **{stage: " ".join(found) for stage, found in codes.items()},
        }
    )


def _recorded_codes(journals: Mapping[str, Sequence[Record | None]]) -> dict[str, list[str]]:
    """Return the codes that processed the units of each journal."""
    found = {
        stage.stage: sorted({split_key(r["key"]).get(CODE, "") for r in journals[stage.stage] if r})
        for stage in all_stages()
    }
    return {stage: codes for stage, codes in found.items() if codes}


def _check_block(run: Run, group: StoreGroup) -> None:
    held = group.attrs.get("block", run.block)
    if held != run.block:
        raise InputError(
            f"{run.out}: holds block {held}; give block {run.block} a folder of its own beside it with --out, and "
            f"`{format_command('query', run.folder.parent)}` finds both"
        )
