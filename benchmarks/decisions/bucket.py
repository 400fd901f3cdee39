"""0071: what a unit's commit costs in a bucket, beside the same in a folder."""

from __future__ import annotations

import os
import statistics
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.s3_server import serving
from benchmarks.timing import figures
from catalogs.published.s3 import S3Folder, folder_at
from facade_core.atlas.arrays import create_arrays
from facade_core.atlas.location import Place
from facade_core.atlas.store import commit, new_root, open_repository, open_root
from facade_core.core.atlas_spec import AtlasSpec
from tasks.kinds.order import STAGES
from tasks.store.commits import begin, finish

# Chunks of a facade's seed and evidence, about.
CHUNKS = 16


def measure(quick: bool, data: Path | None) -> dict[str, Any]:
    """Units of a facade's size one after the other: session, fork, 16 chunks of two arrays, record, commit.

    The bucket is that of BENCH_BUCKET (s3://bucket/prefix); without it, of a server on loopback, `benchmarks/s3_server.py`.
    """
    units = 5 if quick else 40
    found: dict[str, Any] = {"units": units}
    with tempfile.TemporaryDirectory() as folder, _bucket() as bucket:
        for name, place in (("folder", Path(folder) / "store"), ("bucket", bucket / "store")):
            found[name] = _units(place, units)
        if isinstance(bucket, S3Folder):
            bucket.remove()
    found["seconds_ratio"] = figures(found["bucket"]["unit_ms"] / found["folder"]["unit_ms"])
    return found


def _units(place: Place, units: int) -> dict[str, float]:
    rng = np.random.default_rng(0)
    repository = open_repository(place, create=True)
    session = repository.writable_session("main")
    spec = AtlasSpec(1, 20.0)
    create_arrays(new_root(session), spec, dict.fromkeys(STAGES, units), crs="EPSG:32635", panorama_width=512)
    commit(session, "arrays")
    lasting, committing = [], []
    for unit in range(units):
        start = time.perf_counter()
        session, fork = begin(place)
        group, top = open_root(fork), unit % (spec.page // spec.chunk) * spec.chunk
        rows, columns = slice(top, top + spec.chunk), slice(0, CHUNKS * spec.chunk)
        size = (spec.chunk, CHUNKS * spec.chunk)
        group["atlas/seed"][0, rows, columns] = rng.integers(0, 256, (*size, 3), dtype=np.uint8)
        group["atlas/seed_evidence"][0, rows, columns] = rng.integers(1, 5, size, dtype=np.uint8)
        written = time.perf_counter()
        finish(session, fork, "facades", {unit: {"unit": str(unit), "key": "k", "status": "done"}}, f"unit {unit}")
        committing.append(time.perf_counter() - written)
        lasting.append(time.perf_counter() - start)
    return {
        "unit_ms": figures(1000 * statistics.median(lasting)),
        "commit_ms": figures(1000 * statistics.median(committing)),
        "commits_per_second": figures(1 / statistics.median(committing)),
    }


@contextmanager
def _bucket() -> Iterator[S3Folder]:
    if given := os.environ.get("BENCH_BUCKET"):
        yield folder_at(f"{given.rstrip('/')}/bench-{os.getpid()}")  # type: ignore[misc]
        return
    with serving("bench", "bench", "bench") as variables:
        os.environ |= variables
        yield S3Folder("bench/run")
