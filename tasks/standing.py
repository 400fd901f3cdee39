"""Whether a run has anything left to do: read from the store alone, so that asking costs no server and no cluster."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import zarr

from facade_core.atlas.journal import STAGES, read_journal
from facade_core.atlas.store import BRANCH, open_repository
from facade_core.atlas.zarr_types import StoreGroup
from facade_core.errors import InputError, StoreError
from tasks.run import Run


def published_summary(out: Path, snapshot: str) -> dict[str, Any]:
    """The summary of a published snapshot, with the paths of its outputs."""
    folder = out / "published" / snapshot
    return json.loads((folder / "summary.json").read_text()) | {
        "outputs": {
            "glb": [str(folder / "block.glb")],
            "report": str(folder / "report" / "index.html"),
            "items": str(folder / "items.parquet"),
        },
    }


def current_snapshot(out: Path) -> str | None:
    """The published snapshot that `current` points at, None where there is none."""
    pointer = out / "current"
    snapshot = pointer.read_text().strip() if pointer.is_file() else ""
    return snapshot if snapshot and (out / "published" / snapshot / "summary.json").is_file() else None


def page_path(published: Path, page: int) -> Path:
    """Where a page of the atlas, filled, lies in the folder of a published snapshot."""
    return published / "pages" / f"{page:04}.jpg"


def nothing_due(run: Run) -> dict[str, Any] | None:
    """The summary of `run` when its every unit is done and its newest snapshot published; None when there is work.

    What any unit's key stands on is in the run's key too: while that is the same, so are they all.
    Raises InputError when the store is another block's, which a run would overwrite.
    """
    if not run.store.is_dir():
        return None
    try:
        session = open_repository(run.store).readonly_session(BRANCH)
        group: StoreGroup = zarr.open_group(session.store, mode="r")
        _check_block(run, group)
        if group.attrs.get("key") != run.key or current_snapshot(Path(run.out)) != session.snapshot_id:
            return None
        records = [record for stage in STAGES for record in read_journal(group, stage)]
    except (StoreError, KeyError, FileNotFoundError):
        return None
    if not all(record and record["status"] == "done" for record in records):
        return None
    summary = published_summary(Path(run.out), session.snapshot_id)
    set_aside = [{"unit": unit, "reason": reason} for _, unit, reason in group.attrs["set_aside"]]
    return summary | {"out": run.out, "units_skipped": len(records) + 1, "units_done": 0, "failures": set_aside}


def _check_block(run: Run, group: StoreGroup) -> None:
    held = group.attrs.get("block", run.block)
    if held != run.block:
        raise InputError(
            f"{run.out}: holds block {held}; give block {run.block} a folder of its own beside it with --out, and "
            f"`streetloom query {Path(run.out).parent}` finds both"
        )
