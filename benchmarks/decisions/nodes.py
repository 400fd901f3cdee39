"""0005: a commit in a store with a group per facade, and in one whose facades share arrays."""

from __future__ import annotations

import statistics
import tempfile
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import zarr

from benchmarks.timing import bytes_in, figures, once
from facade_core.atlas.store import commit, open_repository, open_root

MAPS = ("evidence", "labels", "occluded")
CHUNK = 128


def measure(quick: bool, data: Path | None) -> dict[str, Any]:
    """Milliseconds and bytes of committing one facade's three maps, by how many facades the block has."""
    counts, repeats = ((5, 20), 2) if quick else ((100, 1000), 15)
    figured: dict[str, Any] = {}
    for facades in counts:
        with tempfile.TemporaryDirectory() as folder:
            shared = _commit_one(Path(folder) / "shared", facades, repeats, grouped=False)
            grouped = _commit_one(Path(folder) / "grouped", facades, repeats, grouped=True)
        figured[str(facades)] = {"shared_arrays": shared, "group_per_facade": grouped}
    return {"facades": figured}


def _commit_one(store: Path, facades: int, repeats: int, *, grouped: bool) -> dict[str, float]:
    repository = open_repository(store, create=True)
    session = repository.writable_session("main")
    root = zarr.group(store=session.store)
    for folder in [f"facades/{i}" for i in range(facades)] if grouped else ["facade_maps"]:
        for name in MAPS:
            shape = (1 if grouped else facades, CHUNK, CHUNK)
            root.create_array(f"{folder}/{name}", shape=shape, chunks=(1, CHUNK, CHUNK), dtype="uint8")
    commit(session, "arrays")
    rng = np.random.default_rng(0)
    times, before = [], bytes_in(store)
    for facade in range(repeats):
        session = repository.writable_session("main")
        group = open_root(session)
        for name in MAPS:
            noise = rng.integers(0, 256, (CHUNK, CHUNK), dtype=np.uint8)
            if grouped:
                group[f"facades/{facade}/{name}"][0] = noise
            else:
                group[f"facade_maps/{name}"][facade] = noise
        times.append(once(partial(commit, session, f"facade {facade}")))
    grown = (bytes_in(store) - before) / repeats - len(MAPS) * CHUNK * CHUNK
    return {"commit_ms": figures(1000 * statistics.median(times)), "metadata_kb_per_commit": figures(grown / 1e3)}
