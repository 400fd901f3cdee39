"""Integrity checks of a store and rollback to a readable snapshot.

Readable data is never removed.
"""

from __future__ import annotations

import asyncio
import errno
import json
import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import icechunk
import zarr
from zarr.types import AnyArray as ZarrArray

from facade_core.atlas.store import BRANCH, Repository, open_repository
from facade_core.atlas.store_location import StoreLocation
from facade_core.core.errors import LostStoreError, MachineError, StoreError

# Errors of reading a damaged store: those of Icechunk, zarr and codecs, and of truncated files.
DAMAGE_ERRORS = (icechunk.IcechunkError, OSError, RuntimeError, ValueError, KeyError, TypeError, EOFError)
READ_THREADS = 4
# The first, empty snapshot of every Icechunk repository.
FIRST_SNAPSHOT_ID = "1CECHNKREP0F1RSTCMT0"

ChunkCoordinates = tuple[int, ...]


@dataclass(frozen=True)
class Rollback:
    """Record of a store that went back to an earlier snapshot.

    Attributes
    ----------
    snapshot : id of the snapshot that the branch names now.
    written_at : time of that snapshot.
    reason : why newer snapshots cannot be read.
    """

    snapshot: str
    written_at: datetime
    reason: str


def roll_back_to_readable(path: StoreLocation, verify: Callable[[icechunk.Session], None]) -> Rollback | None:
    """Move the branch to the newest readable snapshot if its tip cannot be read.

    Removes the leftovers of a process that was killed while it created the store.

    Parameters
    ----------
    path : folder of the store.
    verify : reads the required content of a snapshot; raises one of `DAMAGE_ERRORS` if it cannot.

    Returns
    -------
    The rollback, or None if the tip is readable or nothing was ever committed.

    Raises
    ------
    LostStoreError
        No snapshot is readable.
    MachineError
        The disk or the bucket refuses a file.
    """
    if _was_never_committed(path):
        if isinstance(path, Path):
            shutil.rmtree(path)
        else:
            path.remove()
        return None
    if _find_fault(path, verify) is None:
        return None
    require_readable_files(path)
    if (reason := _find_fault(path, verify)) is None:
        return None
    for made, snapshot in _list_snapshots(path):
        try:
            verify(open_repository(path).readonly_session(snapshot_id=snapshot))
        except (StoreError, *DAMAGE_ERRORS):
            continue
        _write_branch(path, snapshot)
        return Rollback(snapshot, made, reason)
    raise LostStoreError(
        f"{path}: cannot be read ({reason}), nor any earlier snapshot; restore a copy of it, or name another folder with --out"
    )


def require_readable_files(path: StoreLocation) -> None:
    """Read every file of a store: only what can be read and not decoded is damaged, or a file with a bad sector.

    Raises
    ------
    MachineError
        The disk or the bucket refuses a file.
    """
    if not isinstance(path, Path):
        with ThreadPoolExecutor(READ_THREADS) as threads:
            list(threads.map(lambda name: len((path / name).read_bytes()), path.sizes()))
        return
    for file in (file for file in path.rglob("*") if file.is_file()):
        try:
            file.read_bytes()
        except OSError as error:
            if error.errno != errno.EIO:
                raise MachineError(
                    f"{file}: cannot be read ({error.strerror}); see to its permissions and its disk, and run again: "
                    "finished work is kept"
                ) from error


def _find_fault(path: StoreLocation, verify: Callable[[icechunk.Session], None]) -> str | None:
    """Return why the newest snapshot cannot be read; None if it can, or if nothing was ever committed."""
    try:
        repository = open_repository(path)
        tip = repository.lookup_branch(BRANCH)
        if repository.lookup_snapshot(tip).parent_id is not None:
            verify(repository.readonly_session(snapshot_id=tip))
    except (StoreError, *DAMAGE_ERRORS) as error:
        return _first_line(error.__cause__ if isinstance(error, StoreError) and error.__cause__ else error)
    return None


def list_chunks(session: icechunk.Session, array: str) -> set[ChunkCoordinates]:
    """List the coordinates of an array's chunks from its manifest, without reading a chunk."""

    async def list_all() -> set[ChunkCoordinates]:
        return {tuple(coordinates) async for coordinates in session.chunk_coordinates(f"/{array}")}

    with ThreadPoolExecutor(1) as thread:  # the caller's thread may run an event loop
        return thread.submit(asyncio.run, list_all()).result()


def has_all_files(repository: Repository, path: StoreLocation) -> bool:
    """Return True if every manifest and chunk of a branch or tag exists in its recorded size.

    Reads sizes and manifests only.
    """
    manifests = _file_sizes(path / "manifests")
    try:
        snapshots = [repository.lookup_branch(BRANCH), *map(repository.lookup_tag, repository.list_tags())]
        if not all(_has_all_manifests(repository, manifests, snapshot) for snapshot in snapshots):
            return False
        stored_bytes = repository.chunk_storage_stats().native_bytes
    except DAMAGE_ERRORS:
        return False
    return sum(_file_sizes(path / "chunks").values()) >= stored_bytes


def find_broken_tags(repository: Repository, path: StoreLocation) -> list[str]:
    """List tags whose reference, snapshot or manifests cannot be read."""
    broken, manifests = [], _file_sizes(path / "manifests")
    for tag in sorted(repository.list_tags()):
        try:
            whole = _has_all_manifests(repository, manifests, repository.lookup_tag(tag))
        except DAMAGE_ERRORS:
            whole = False
        if not whole:
            broken.append(tag)
    return broken


def find_unreadable_chunks(session: icechunk.Session) -> dict[str, list[ChunkCoordinates] | None]:
    """Read every chunk of a snapshot and list unreadable ones.

    Returns
    -------
    Coordinates of unreadable chunks by array path; None for an array whose manifest cannot be read.
    """
    group = zarr.open_group(session.store, mode="r")
    unreadable: dict[str, list[ChunkCoordinates] | None] = {}
    arrays = [(path, node) for path, node in group.members(max_depth=None) if isinstance(node, zarr.Array)]
    with ThreadPoolExecutor(READ_THREADS) as threads:
        for path, array in sorted(arrays):
            try:
                listed = sorted(list_chunks(session, path))
            except DAMAGE_ERRORS:
                unreadable[path] = None
                continue
            results = threads.map(lambda chunk, array=array: _is_readable(array, chunk), listed)
            if lost := [chunk for chunk, readable in zip(listed, results, strict=True) if not readable]:
                unreadable[path] = lost
    return unreadable


def _is_readable(array: ZarrArray, chunk: ChunkCoordinates) -> bool:
    try:
        array.get_block_selection(chunk)
    except DAMAGE_ERRORS:
        return False
    return True


def _has_all_manifests(repository: Repository, manifest_sizes: Mapping[str, int], snapshot: str) -> bool:
    """Compare a snapshot's manifests with the files.

    Raises one of `DAMAGE_ERRORS` if the snapshot cannot be read.
    """
    manifests = json.loads(repository.inspect_snapshot(snapshot))["manifests"]
    return all(manifest_sizes.get(manifest["id"]) == manifest["size_bytes"] for manifest in manifests)


def _file_sizes(folder: StoreLocation) -> dict[str, int]:
    """Return file sizes in bytes of a folder of a store that has no subfolders."""
    if not isinstance(folder, Path):
        return folder.sizes()
    return {entry.name: entry.stat().st_size for entry in os.scandir(folder)} if folder.is_dir() else {}


def _was_never_committed(path: StoreLocation) -> bool:
    """Return True if a folder has no branch and no snapshot but the empty first one."""
    if isinstance(path, Path):
        if any((path / "refs").glob("*/ref.json")):
            return False
        files = [file.relative_to(path) for file in path.rglob("*") if file.is_file()]
    else:
        if any(name.endswith("/ref.json") for name in (path / "refs").sizes()):
            return False
        files = list(map(Path, path.sizes()))
    return all(
        file.parent.name == "refs" or file.name.startswith(FIRST_SNAPSHOT_ID) or "#" in file.name for file in files
    )


def _list_snapshots(path: StoreLocation) -> Iterator[tuple[datetime, str]]:
    """Yield readable snapshots with content, newest first."""
    names = sorted(_file_sizes(path / "snapshots"))
    try:
        repository = open_repository(path)
    except StoreError:  # a repository needs a branch: point it at any snapshot
        if not names:
            return
        _write_branch(path, names[0])
        repository = open_repository(path)
    snapshots = []
    for name in names:
        try:
            info = repository.lookup_snapshot(name)
        except DAMAGE_ERRORS:
            continue
        if info.parent_id is not None:
            snapshots.append((info.written_at, name))
    yield from sorted(snapshots, reverse=True)


def _write_branch(path: StoreLocation, snapshot: str) -> None:
    """Write the branch's reference file.

    Icechunk refuses to open a repository with a damaged reference, so its own call cannot be used.
    """
    folder, content = path / "refs" / f"branch.{BRANCH}", json.dumps({"snapshot": snapshot})
    if not isinstance(folder, Path):
        (folder / "ref.json").write_text(content)
        return
    folder.mkdir(parents=True, exist_ok=True)
    temporary = folder / ".ref.tmp"
    temporary.write_text(content)
    os.replace(temporary, folder / "ref.json")


def _first_line(error: BaseException) -> str:
    words = str(error).strip() or type(error).__name__
    return words.splitlines()[0].strip(" x")
