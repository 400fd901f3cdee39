"""Removal of old snapshots: their published folders and unshared chunks, and files of killed processes."""

from __future__ import annotations

import os
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

from catalogs.published import object_store
from catalogs.published.file_list import FILE_LIST_NAME, read_predecessor, replace_files
from catalogs.published.folders import Folder, remove_path
from catalogs.published.runs import publish_hint
from catalogs.published.s3 import S3Path
from catalogs.published.snapshot import SnapshotFolder, find_current_snapshot
from catalogs.stac.versions import find_dead_version_links
from facade_core.atlas.integrity import has_all_files
from facade_core.atlas.store import expire_snapshots, open_repository
from facade_core.core.errors import FacadeError, InputError

# Files that a killed process leaves in the folder of a run. The lock of the run, which the caller holds, excludes live ones.
LEFTOVER_PATTERNS = (
    "published/.*.tmp",
    ".current.tmp",
    ".latest.tmp",
    "published/*/**/.*.tmp",
    ".catalog.json.*.tmp",
    ".seen-*",
    ".doctor-*.tmp",
    "store/refs/*/.ref.tmp",
)
# A bucket does not record its readers: a snapshot superseded within this time stays.
READER_GRACE = timedelta(hours=1)


def prune_snapshots(out: Folder, keep: int, read_for: timedelta = READER_GRACE) -> list[str]:
    """Remove all but the newest published snapshots of a run; returns lines that list removed and kept ones.

    The current snapshot and snapshots with readers stay. The caller holds the lock of the run.

    Parameters
    ----------
    out : folder of the run.
    keep : number of snapshots to keep.
    read_for : how long a superseded snapshot in a bucket may still have readers.

    Raises
    ------
    InputError : nothing is published, or a damaged store hides which chunks are in use.
    """
    current = find_current_snapshot(out)
    if current is None:
        raise InputError(f"{out}: nothing is published; {publish_hint(out, 'publishes')}")
    repository = open_repository(out / "store")
    if not has_all_files(repository, out / "store"):
        raise InputError(f"{out / 'store'}: is damaged; {publish_hint(out, 'mends it first')}")
    lines = []
    size = _folder_bytes(out)
    leftovers = _find_leftovers(out)
    for path in leftovers:
        remove_path(path)
    published = out / "published"
    gone, readers = 0, []
    order = _newest_first(published, current.id)
    for newer, name in list(zip(order, order[1:], strict=False))[keep - 1 :]:
        with SnapshotFolder(published / name).lock_exclusively() as nobody:
            if not nobody or _is_recently_superseded(published / newer, read_for):
                readers.append(name)
                continue
            _remove_snapshot(published, name)
            gone += 1
    for name, contents in find_dead_version_links(published):
        replace_files(published / name, contents)
    for tag in repository.list_tags():
        if tag.startswith("street-"):  # of stores of 0.1.0
            repository.delete_tag(tag)
    expire_snapshots(repository, read_for if isinstance(out, S3Path) else timedelta())
    freed = (size - _folder_bytes(out)) / (1 << 20)
    lines.append(f"{out}: removed {gone} published snapshots and {len(leftovers)} leftovers, {max(freed, 0):.1f} MB")
    if readers:
        lines.append(
            f"{out}: kept {', '.join(readers)}, which somebody {'may read' if isinstance(out, S3Path) else 'reads'}"
        )
    return lines


def prune_snapshots_or_explain(out: Folder, keep: int) -> list[str]:
    """Prune at the end of a run; on failure return a line with the reason, so that the run succeeds."""
    try:
        return prune_snapshots(out, keep)
    except (FacadeError, OSError) as error:
        return [f"nothing more is pruned: {' '.join(str(error).split())}"]


def _find_leftovers(out: Folder) -> list[Folder]:
    if not isinstance(out, S3Path):
        return [path for pattern in LEFTOVER_PATTERNS for path in out.glob(pattern)]
    # only a complete upload has a list of files
    published = [path for path in (out / "published").iterdir() if not (path / FILE_LIST_NAME).is_file()]
    return [*published, *(path for path in out.iterdir() if path.name.startswith(".seen-"))]


def _is_recently_superseded(newer: Folder, read_for: timedelta) -> bool:
    """Return whether a snapshot in a bucket became current less than `read_for` ago."""
    if not isinstance(newer, S3Path):
        return False
    listed = object_store.list_objects(newer.path).get(FILE_LIST_NAME)
    return listed is not None and datetime.now(UTC) - listed.written < read_for


def _remove_snapshot(published: Folder, name: str) -> None:
    """Hide a snapshot from readers in one step, then remove its files."""
    if isinstance(published, S3Path):
        (published / name / FILE_LIST_NAME).unlink()
        remove_path(published / name)
        return
    os.replace(published / name, published / f".{name}.gone.tmp")
    remove_path(published / f".{name}.gone.tmp")


def _newest_first(published: Folder, current: str) -> list[str]:
    """Return the published snapshots, each before its predecessor; unlinked ones come last, by time."""
    folders = {path.name: path for path in published.iterdir() if path.is_dir() and not path.name.startswith(".")}
    order = [current]
    while (before := read_predecessor(published / order[-1])) in folders and before not in order:
        order.append(str(before))
    return order + sorted(folders.keys() - set(order), key=lambda name: -_written_time(folders[name]))


def _written_time(folder: Folder) -> float:
    """Return when a folder was written, seconds since 1970."""
    if isinstance(folder, S3Path):
        return max(
            (entry.written.timestamp() for entry in object_store.list_objects(folder.path).values()), default=0.0
        )
    return folder.stat().st_mtime


def _folder_bytes(out: Folder) -> int:
    """Return the size of a run, with files that snapshots share counted once, except in a bucket."""
    if isinstance(out, S3Path):
        return sum(sum((out / folder).sizes().values()) for folder in ("store", "published"))
    found = (entry.stat() for folder in ("store", "published") for entry in _walk_files(out / folder))
    return sum({(stat.st_dev, stat.st_ino): stat.st_size for stat in found}.values())


def _walk_files(folder: Path) -> Iterator[os.DirEntry[str]]:
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_dir(follow_symlinks=False):
                yield from _walk_files(Path(entry.path))
            else:
                yield entry
