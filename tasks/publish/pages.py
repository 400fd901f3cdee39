"""The pages of the atlas as their units encoded them."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from catalogs.published.reuse import SnapshotFiles
from catalogs.published.snapshot import Snapshot
from facade_core.atlas.stored_files import page_path, read_stored_file
from tasks.publish.partial_failures import PartialFailures
from tasks.publish.stored_block import StoredBlock


def write_pages(snapshot: Snapshot[Path], block: StoredBlock, files: SnapshotFiles, failures: PartialFailures) -> None:
    """Write pages/; one that cannot be read is set failures."""
    for number, record in enumerate(block.journals["pages"]):
        if record is None or record["status"] != "done":  # the journal says why
            continue
        path, digest = page_path(number), record["digest"]
        with failures.attempt(f"page {record['unit']}"):
            files.add_file(
                snapshot.page(number).relative_to(snapshot.folder).as_posix(),
                digest,
                partial(read_stored_file, block.group, path, digest),
            )
