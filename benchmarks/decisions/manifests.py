"""0045: what a commit costs in a store of many units, by how many chunks a manifest lists, and what is read of it all.

The stores have the arrays of a run, with about as many pages as the demo has for its units, and their journals; chunks of
pictures are references to nothing, of the size that Icechunk's own are. A commit is that of a facade or a viewpoint, as a run
makes it.
"""

from __future__ import annotations

import json
import secrets
import statistics
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, cast

import icechunk
import numpy as np

from benchmarks.timing import bytes_in, figures
from facade_core.atlas.arrays import ARRAYS, PAGE, create_arrays
from facade_core.atlas.integrity import chunks_of
from facade_core.atlas.journal import Record, read_journal, write_record
from facade_core.atlas.store import BRANCH, Repository, commit, configuration, new_root, open_repository, open_root
from facade_core.atlas.stored_files import hierarchy_path, write_encoded
from facade_core.core.atlas_spec import AtlasSpec

# Of the demo's 159 units 43 are facades, and it has 20 pages.
FACADES, PAGES = 43 / 159, 20 / 159
# Chunks of a page that hold something; so many units, and pages, in a manifest.
FILLED = 0.75
SPLITS = ((64, 1), (64, 4), (64, 8), (256, 4))
REPEATS = 7


def measure(quick: bool, data: Path | None) -> dict[str, Any]:
    """By number of units and split: commits, opening, reading all journals, and listing all chunks."""
    sizes, splits = ((60,), ((16, 2),)) if quick else ((2_000, 10_000), SPLITS)
    return {str(n): {_name(split): _figures(n, split) for split in (None, *splits)} for n in sizes}


def _name(split: tuple[int, int] | None) -> str:
    return "whole" if split is None else f"{split[0]} units, {split[1]} pages"


def _figures(units: int, split: tuple[int, int] | None) -> dict[str, Any]:
    config = icechunk.RepositoryConfig.default() if split is None else configuration(*split)
    with tempfile.TemporaryDirectory() as folder:
        store = Path(folder) / "store"
        open_repository(store, create=True)

        def opened() -> Repository:
            repository = cast(Repository, Repository.open(icechunk.local_filesystem_storage(str(store)), config))
            repository.path = store
            return repository

        count = _fill(opened(), units)
        rng = np.random.default_rng(1)
        newest = opened().readonly_session(BRANCH)
        return {
            **count,
            "facade": _commits(store, opened, lambda session: _facade(session, count, rng)),
            "viewpoint": _commits(store, opened, lambda session: _viewpoint(session, count, rng)),
            "open_ms": _milliseconds(lambda: open_root(opened().readonly_session(BRANCH))),
            "journals_ms": _milliseconds(lambda: _journals(opened())),
            "all_chunks_ms": _milliseconds(lambda: _all_chunks(opened())),
            "manifests": len(json.loads(opened().inspect_snapshot(newest.snapshot_id))["manifests"]),
            "store_mb": figures(bytes_in(store) / 1e6),
        }


def _fill(repository: Repository, units: int) -> dict[str, int]:
    facades = round(units * FACADES)
    viewpoints, pages = units - facades, max(1, round(units * PAGES))
    session = repository.writable_session(BRANCH)
    counts = {"poses": 0, "exemplars": 14, "textures": 0, "facades": facades, "viewpoints": viewpoints, "streets": 1}
    spec = AtlasSpec(pages, 16.0)
    create_arrays(new_root(session), spec, counts, crs="EPSG:32635", panorama_width=1024)
    commit(session, "arrays")
    session = repository.writable_session(BRANCH)
    rng = np.random.default_rng(0)
    side = spec.page // spec.chunk
    for array in ARRAYS:
        if array.dims[:3] == PAGE:
            held = np.argwhere(rng.random((pages, side, side)) < FILLED).tolist()
            _refer(session, array.path, [[*one, *[0] * (len(array.dims) - 3)] for one in held])
    _refer(session, "panoramas/rgb", [[viewpoint, 0, 0, 0] for viewpoint in range(viewpoints)])
    group = open_root(session)
    for stage, count in (("facades", facades), ("viewpoints", viewpoints)):
        for index in range(count):
            write_record(group, stage, index, _record(index, rng, elements=40 if stage == "facades" else 0))
    commit(session, "units")
    return {"facades": facades, "viewpoints": viewpoints, "pages": pages}


def _refer(session: icechunk.Session, array: str, chunks: Iterable[list[int]]) -> None:
    """Chunks of an array that lie elsewhere: names as random, and as long, as Icechunk's."""
    specs = [icechunk.VirtualChunkSpec(one, f"file:///{secrets.token_hex(10)}", 0, 9_000) for one in chunks]
    session.store.set_virtual_refs(array, specs, validate_containers=False)


def _record(index: int, rng: np.random.Generator, *, elements: int) -> Record:
    places = rng.uniform(0, 100, (elements, 4)).round(2).tolist()
    return {
        "unit": f"way/{7919 * index}-0",
        "key": " ".join(f"{kind}:{secrets.token_hex(8)}" for kind in ("code", "settings", "geometry", "exemplar")),
        "status": "done",
        "started": time.time(),
        "seconds": {"read": 0.01, "parse": 0.3, "write": 0.02},
        "digests": {secrets.token_hex(8): secrets.token_hex(8)},
        "elements": [["window", *place] for place in places],
    }


def _commits(store: Path, opened: Callable[[], Repository], write: Callable[[Any], None]) -> dict[str, float]:
    """Medians of opening a session and committing what is written there, and of the bytes by which the store grows."""
    seconds, grown = [], []
    for _ in range(REPEATS):
        before, start = bytes_in(store), time.perf_counter()
        session = opened().writable_session(BRANCH)
        write(session)
        commit(session, "unit")
        seconds.append(time.perf_counter() - start)
        grown.append(bytes_in(store) - before)
    return {"ms": figures(1000 * statistics.median(seconds)), "kb": figures(statistics.median(grown) / 1e3)}


def _facade(session: Any, count: dict[str, int], rng: np.random.Generator) -> None:
    """A chunk of each raster that the facade stage writes, the hierarchy and the record."""
    group = open_root(session)
    page, facade = int(rng.integers(count["pages"])), int(rng.integers(count["facades"]))
    for array in ARRAYS:
        if array.dims[:3] == PAGE and "street" not in array.path:
            group[array.path][page, :128, :128] = 1
    write_encoded(group, hierarchy_path(facade), b"-" * 18_000, "variations")
    write_record(group, "facades", facade, _record(facade, rng, elements=40))


def _viewpoint(session: Any, count: dict[str, int], rng: np.random.Generator) -> None:
    group, viewpoint = open_root(session), int(rng.integers(count["viewpoints"]))
    group["panoramas/rgb"][viewpoint] = 1
    write_record(group, "viewpoints", viewpoint, _record(viewpoint, rng, elements=0))


def _journals(repository: Repository) -> None:
    group = open_root(repository.readonly_session(BRANCH))
    for stage in ("facades", "viewpoints"):
        read_journal(group, stage)


def _all_chunks(repository: Repository) -> None:
    """As a run looks for what its store lost, before it starts."""
    session = repository.readonly_session(BRANCH)
    for array in ARRAYS:
        chunks_of(session, array.path)


def _milliseconds(action: Callable[[], object]) -> float:
    times = []
    for _ in range(3):
        start = time.perf_counter()
        action()
        times.append(time.perf_counter() - start)
    return figures(1000 * statistics.median(times))
