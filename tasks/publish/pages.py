"""The pages of the atlas as their units encoded them."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from catalogs.published.reuse import SnapshotFiles
from catalogs.published.snapshot import Snapshot
from facade_core.atlas.stored_files import page_path, read_stored_file
from tasks.publish.aside import Aside
from tasks.publish.stored import StoredBlock


def write_pages(snapshot: Snapshot[Path], block: StoredBlock, made: SnapshotFiles, aside: Aside) -> None:
    """Write pages/; one that cannot be read is set aside."""
    for number, record in enumerate(block.journals["pages"]):
        if record is None or record["status"] != "done":  # the journal says why
            continue
        path, digest = page_path(number), record["digest"]
        with aside.trying(f"page {record['unit']}"):
            made.add_file(
                snapshot.page(number).relative_to(snapshot.folder).as_posix(),
                digest,
                partial(read_stored_file, block.group, path, digest),
            )
