"""Journals that a process reads again and again, held between two readings: of a later snapshot only what was committed since
is read. Whoever commits says what that is."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from threading import Lock

import icechunk
import numpy as np

from facade_core.atlas.store_location import StoreLocation
from facade_core.core.zarr_types import StoreGroup


@dataclass
class _CachedJournals:
    """Arrays by their paths as they are at a snapshot, but for some elements of each, which others were committed over."""

    snapshot: str | None = None
    arrays: dict[str, np.ndarray] = field(default_factory=dict)
    stale: defaultdict[str, set[int]] = field(default_factory=lambda: defaultdict(set))


# By the folder of a store.
_caches: dict[StoreLocation, _CachedJournals] = {}
_cache_lock = Lock()


@contextmanager
def cache_journals(store: StoreLocation) -> Iterator[None]:
    """While this lasts, `read_held` reads each array of the store in a folder once, and then what was committed.

    Each record of a journal is a chunk, of which a second reads a thousand, and a run asks for all before each of its stages.
    """
    _caches[store] = _CachedJournals()
    try:
        yield
    finally:
        _caches.pop(store, None)


def read_cached_array(group: StoreGroup, path: str) -> np.ndarray:
    """An array (n,) of a chunk for each element, as the group has it. It is not to be written to.

    The folder of a store is told by its root group (`facade_core.atlas.store`)."""
    array, held = group[path], _caches.get(getattr(group.store, "folder", None))  # type: ignore[arg-type]
    if held is None or (session := group.store.session).has_uncommitted_changes:
        return array[:]
    with _cache_lock:
        if held.snapshot != session.snapshot_id:  # the store went back, or somebody reads what it was
            held.snapshot, held.arrays = session.snapshot_id, {}
        values = held.arrays.pop(path, None)  # until it is read: a reading that fails leaves nothing behind
        stale = np.array(sorted(held.stale.pop(path, ())), np.int64)
        if values is None or values.shape != array.shape:
            values = array[:]
        elif len(stale):
            values = values.copy()
            values[stale] = array.oindex[stale]
        held.arrays[path] = values
    return values


def update_cached_journals(store: StoreLocation, parent: str | None, snapshot: str, changes: icechunk.Diff) -> None:
    """A snapshot was committed on top of its parent in the store in a folder, with some changes."""
    if (held := _caches.get(store)) is None:
        return
    with _cache_lock:
        if held.snapshot != parent:  # what else was committed nobody said
            held.arrays = {}
        for name in changes.new_arrays | changes.updated_arrays | changes.deleted_arrays:
            held.arrays.pop(name.removeprefix("/"), None)
        for name, chunks in changes.updated_chunks.items():
            if (path := name.removeprefix("/")) in held.arrays:
                held.stale[path].update(chunk[0] for chunk in chunks)
        held.snapshot = snapshot
