"""Whether a store can be read, and what is left where it cannot. Nothing here removes what can still be read."""

from __future__ import annotations

import asyncio
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

from facade_core.atlas.store import BRANCH, Repository, open_repository
from facade_core.atlas.store_location import StoreLocation
from facade_core.core.errors import LostStoreError, StoreError

# What reading a damaged store raises: Icechunk's and zarr's own errors, those of codecs, and of what was cut short.
DAMAGE_ERRORS = (icechunk.IcechunkError, OSError, RuntimeError, ValueError, KeyError, TypeError, EOFError)
READ_THREADS = 4
# The snapshot that every repository of Icechunk begins with.
FIRST_SNAPSHOT_ID = "1CECHNKREP0F1RSTCMT0"

ChunkCoordinates = tuple[int, ...]


@dataclass(frozen=True)
class Rollback:
    """The snapshot that a store stands on now, when it was made, and why not on a newer one."""

    snapshot: str
    made: datetime
    reason: str


def roll_back_to_readable(path: StoreLocation, verify: Callable[[icechunk.Session], None]) -> Rollback | None:
    """Let the branch of the store in `path` name the newest snapshot that can be read, if the one that it names cannot.

    sound: reads what a snapshot must hold, and raises one of DAMAGE_ERRORS where it cannot. Returns None where nothing was amiss, or
    nothing was ever committed: what a process that was killed while it made the store has left is removed. Raises
    LostStoreError where no snapshot is readable.
    """
    if _was_never_committed(path):
        if isinstance(path, Path):
            shutil.rmtree(path)
        else:
            path.remove()
        return None
    try:
        repository = open_repository(path)
        tip = repository.lookup_branch(BRANCH)
        if repository.lookup_snapshot(tip).parent_id is None:
            return None
        verify(repository.readonly_session(snapshot_id=tip))
        return None
    except (StoreError, *DAMAGE_ERRORS) as error:
        reason = _first_line(error.__cause__ if isinstance(error, StoreError) and error.__cause__ else error)
    for made, snapshot in _list_snapshots(path):
        try:
            verify(open_repository(path).readonly_session(snapshot_id=snapshot))
        except (StoreError, *DAMAGE_ERRORS):
            continue
        _write_branch(path, snapshot)
        return Rollback(snapshot, made, reason)
    raise LostStoreError(
        f"{path}: cannot be read ({reason}), nor any earlier snapshot; move {path} away, and run again"
    )


def list_chunks(session: icechunk.Session, array: str) -> set[ChunkCoordinates]:
    """The chunks that an array has, by their coordinates, as the manifest lists them: none of them is read."""

    async def listed() -> set[ChunkCoordinates]:
        return {tuple(one) async for one in session.chunk_coordinates(f"/{array}")}

    with ThreadPoolExecutor(1) as thread:  # the caller's may have an event loop of its own
        return thread.submit(asyncio.run, listed()).result()


def has_all_files(repository: Repository, path: StoreLocation) -> bool:
    """Whether every manifest and chunk that a branch or tag holds is there in its size; read from sizes and manifests alone."""
    manifests = _file_sizes(path / "manifests")
    try:
        snapshots = [repository.lookup_branch(BRANCH), *map(repository.lookup_tag, repository.list_tags())]
        if not all(_has_all_manifests(repository, manifests, snapshot) for snapshot in snapshots):
            return False
        held = repository.chunk_storage_stats().native_bytes
    except DAMAGE_ERRORS:
        return False
    return sum(_file_sizes(path / "chunks").values()) >= held


def find_broken_tags(repository: Repository, path: StoreLocation) -> list[str]:
    """Tags whose reference, snapshot or manifests cannot be read."""
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
    """Arrays of a snapshot with chunks that cannot be read, by path, and their coordinates; None where not even the manifest
    can. Reads every chunk there is."""
    group = zarr.open_group(session.store, mode="r")
    found: dict[str, list[ChunkCoordinates] | None] = {}
    arrays = [(path, node) for path, node in group.members(max_depth=None) if isinstance(node, zarr.Array)]
    with ThreadPoolExecutor(READ_THREADS) as threads:
        for path, array in sorted(arrays):
            try:
                listed = sorted(list_chunks(session, path))
            except DAMAGE_ERRORS:
                found[path] = None
                continue
            sound = threads.map(lambda one, array=array: _is_readable(array, one), listed)
            if lost := [one for one, there in zip(listed, sound, strict=True) if not there]:
                found[path] = lost
    return found


def _is_readable(array: zarr.Array, chunk: ChunkCoordinates) -> bool:
    try:
        array.get_block_selection(chunk)
    except DAMAGE_ERRORS:
        return False
    return True


def _has_all_manifests(repository: Repository, manifest_sizes: Mapping[str, int], snapshot: str) -> bool:
    """Whether a snapshot's manifests are there in their sizes. Raises one of DAMAGE_ERRORS where the snapshot cannot be read."""
    manifests = json.loads(repository.inspect_snapshot(snapshot))["manifests"]
    return all(manifest_sizes.get(one["id"]) == one["size_bytes"] for one in manifests)


def _file_sizes(folder: StoreLocation) -> dict[str, int]:
    """The files of a folder of a store, which has none below it, with their sizes in bytes."""
    if not isinstance(folder, Path):
        return folder.sizes()
    return {entry.name: entry.stat().st_size for entry in os.scandir(folder)} if folder.is_dir() else {}


def _was_never_committed(path: StoreLocation) -> bool:
    """Whether a folder is what comes before a repository: no branch, and no snapshot but the first, which holds nothing."""
    if isinstance(path, Path):
        if any((path / "refs").glob("*/ref.json")):
            return False
        files = [file.relative_to(path) for file in path.rglob("*") if file.is_file()]
    else:
        if any(name.endswith("/ref.json") for name in (path / "refs").sizes()):
            return False
        files = list(map(Path, path.sizes()))
    return all(file.parent.name == "refs" or file.name.startswith(FIRST_SNAPSHOT_ID) or "#" in file.name for file in files)


def _list_snapshots(path: StoreLocation) -> Iterator[tuple[datetime, str]]:
    """The snapshots of a store that hold something and can be looked up, newest first."""
    names = sorted(_file_sizes(path / "snapshots"))
    try:
        repository = open_repository(path)
    except StoreError:  # without its branch there is no repository: any will do to look around
        if not names:
            return
        _write_branch(path, names[0])
        repository = open_repository(path)
    found = []
    for name in names:
        try:
            info = repository.lookup_snapshot(name)
        except DAMAGE_ERRORS:
            continue
        if info.parent_id is not None:
            found.append((info.written_at, name))
    yield from sorted(found, reverse=True)


def _write_branch(path: StoreLocation, snapshot: str) -> None:
    """Write the branch's reference, as Icechunk does, which refuses to open a repository whose reference is damaged."""
    folder, said = path / "refs" / f"branch.{BRANCH}", json.dumps({"snapshot": snapshot})
    if not isinstance(folder, Path):
        (folder / "ref.json").write_text(said)
        return
    folder.mkdir(parents=True, exist_ok=True)
    temporary = folder / ".ref.tmp"
    temporary.write_text(said)
    os.replace(temporary, folder / "ref.json")


def _first_line(error: BaseException) -> str:
    words = str(error).strip() or type(error).__name__
    return words.splitlines()[0].strip(" x")
