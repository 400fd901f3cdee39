"""Atlas pages of a snapshot, copied from the store in their encoded form."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from catalogs.published.reuse import SnapshotFileWriter
from catalogs.published.snapshot import SnapshotFolder
from facade_core.atlas.stored_files import page_picture_path, read_stored_file
from tasks.publish.partial_failures import PartialFailures
from tasks.publish.stored_block import StoredBlock


def write_atlas_pages(
    snapshot: SnapshotFolder[Path], block: StoredBlock, files: SnapshotFileWriter, failures: PartialFailures
) -> None:
    """Write the atlas pages of a snapshot; record unreadable pages as failures.

    Parameters
    ----------
    snapshot : snapshot that is written.
    block : block as its store holds it.
    files : files of the snapshot; added to.
    failures : failures so far; added to.
    """
    for number, record in enumerate(block.journals["pages"]):
        if record is None or record["status"] != "done":  # the journal says why
            continue
        path, digest = page_picture_path(number), record["digest"]
        with failures.attempt(f"page {record['unit']}"):
            files.add_file(
                snapshot.page(number).relative_to(snapshot.folder).as_posix(),
                digest,
                partial(read_stored_file, block.group, path, digest),
            )
