"""Cache of the journal, updated from each commit's change set."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from threading import Lock

import icechunk
import numpy as np

from facade_core.atlas.store_location import StoreLocation
from facade_core.core.arrays import AnyArray, IntArray
from facade_core.core.zarr_types import StoreArray, StoreGroup, is_decoding_error


@dataclass
class _CachedJournals:
    """Arrays by path as of one snapshot.

    Attributes
    ----------
    snapshot : id of the snapshot.
    arrays : values by path.
    stale : elements by path that later commits have overwritten.
    """

    snapshot: str | None = None
    arrays: dict[str, AnyArray] = field(default_factory=dict)
    stale: defaultdict[str, set[int]] = field(default_factory=lambda: defaultdict(set))


# Caches by the folder of their store.
_caches: dict[StoreLocation, _CachedJournals] = {}
_cache_lock = Lock()


@contextmanager
def cache_journals(store: StoreLocation) -> Iterator[None]:
    """Cache the journals of a store within a `with` block.

    `read_cached_array` reads each array once and then only committed changes. Each record is a chunk, and a run reads
    all records before each of its stages, at about a thousand chunks per second.
    """
    _caches[store] = _CachedJournals()
    try:
        yield
    finally:
        _caches.pop(store, None)


def read_cached_array(group: StoreGroup, path: str) -> AnyArray:
    """Return a journal array (n,), from the cache where the store is cached; read-only.

    `facade_core.atlas.store` puts the store's folder on the root group's store.
    """
    array, cached = group[path], _caches.get(getattr(group.store, "folder", None))  # type: ignore[arg-type]
    if cached is None or (session := group.store.session).has_uncommitted_changes:
        return read_elements(array, np.arange(array.shape[0]))
    with _cache_lock:
        if cached.snapshot != session.snapshot_id:  # the store was rolled back, or the session is of an older snapshot
            cached.snapshot, cached.arrays = session.snapshot_id, {}
        values = cached.arrays.pop(path, None)  # removed while it is read, so that a failed read leaves nothing behind
        stale = np.array(sorted(cached.stale.pop(path, ())), np.int64)
        if values is None or values.shape != array.shape:
            values = read_elements(array, np.arange(array.shape[0]))
        elif len(stale):
            values = values.copy()
            values[stale] = read_elements(array, stale)
        cached.arrays[path] = values
    return values


def read_elements(array: StoreArray, elements: IntArray) -> AnyArray:
    """Read elements (n,) of a journal array; one that cannot be decoded is empty, so that its unit is pending."""
    try:
        return array.oindex[elements]
    except RuntimeError as error:
        if not is_decoding_error(error):
            raise
        if len(elements) == 1:
            return np.full(1, array.fill_value, array.dtype)
    return np.concatenate([read_elements(array, half) for half in np.array_split(elements, 2)])


def update_cached_journals(store: StoreLocation, parent: str | None, snapshot: str, changes: icechunk.Diff) -> None:
    """Update the cache of a store after a commit.

    Parameters
    ----------
    store : folder of the store.
    parent : id of the snapshot that the commit is based on.
    snapshot : id of the new snapshot.
    changes : change set of the commit.
    """
    if (cached := _caches.get(store)) is None:
        return
    with _cache_lock:
        if cached.snapshot != parent:  # unknown commits in between
            cached.arrays = {}
        for name in changes.new_arrays | changes.updated_arrays | changes.deleted_arrays:
            cached.arrays.pop(name.removeprefix("/"), None)
        for name, chunks in changes.updated_chunks.items():
            if (path := name.removeprefix("/")) in cached.arrays:
                cached.stale[path].update(chunk[0] for chunk in chunks)
        cached.snapshot = snapshot
