"""0003 and 0004: what a commit costs by its chunks, and what storing the blend state would cost."""

from __future__ import annotations

import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.timing import bytes_in, figures
from facade_core.atlas.arrays import create_arrays
from facade_core.atlas.store import commit, new_root, open_repository, open_root
from facade_core.core.atlas_spec import AtlasSpec
from facade_core.street.propagation.blend import BlendState, add_views

VIEWS = 6


def measure(quick: bool, data: Path | None) -> dict[str, Any]:
    """Commits of 10 to 256 chunks of noise, and a whole page of colour and provenance with and without its blend state."""
    page, repeats = (512, 2) if quick else (2048, 15)
    rng = np.random.default_rng(0)
    with tempfile.TemporaryDirectory() as folder:
        store = Path(folder) / "atlas"
        repository = open_repository(store, create=True)
        session = repository.writable_session("main")
        spec = AtlasSpec(1, 20.0, page=page)
        units = dict.fromkeys(("poses", "exemplars", "textures", "facades", "viewpoints", "streets"), 1)
        create_arrays(new_root(session), spec, units, crs="EPSG:32635", panorama_width=512)
        commit(session, "arrays")
        by_chunks = {
            str(n): _commits(repository, store, spec, n, repeats, rng)
            for n in (10, 64, 256)
            if n <= (page // spec.chunk) ** 2
        }
        one_texel = _one_texel(repository, store, rng)
    return {
        "chunk_texels": spec.chunk,
        "commit_of_colour_chunks": by_chunks,
        "kb_for_one_texel": one_texel,
        "page": _page(page, spec.chunk, max(2, repeats // 3), rng),
    }


def _commits(repository: Any, store: Path, spec: AtlasSpec, chunks: int, repeats: int, rng: Any) -> dict[str, float]:
    """Medians of writing and of committing so many whole chunks of colour, and growth of the store by raw bytes written."""
    columns = min(chunks, spec.page // spec.chunk)
    rows, rest = divmod(chunks, columns)
    writing, committing, before = [], [], bytes_in(store)
    for number in range(repeats):
        noise = rng.integers(0, 256, (spec.page, spec.page, 3), dtype=np.uint8)
        start = time.perf_counter()
        session = repository.writable_session("main")
        group = open_root(session)
        colour = group["atlas/colour"]
        size = (rows * spec.chunk, columns * spec.chunk)
        colour[0, : size[0], : size[1]] = noise[: size[0], : size[1]]
        if rest:
            edge = slice(size[0], size[0] + spec.chunk)
            colour[0, edge, : rest * spec.chunk] = noise[edge, : rest * spec.chunk]
        writing.append(time.perf_counter() - start)
        start = time.perf_counter()
        commit(session, f"{chunks} chunks, {number}")
        committing.append(time.perf_counter() - start)
    grown = bytes_in(store) - before
    return {
        "commit_ms": figures(1000 * statistics.median(committing)),
        "write_ms": figures(1000 * statistics.median(writing)),
        "growth_over_raw": figures(grown / (repeats * chunks * spec.chunk**2 * 3)),
    }


def _one_texel(repository: Any, store: Path, rng: Any) -> float:
    before = bytes_in(store)
    session = repository.writable_session("main")
    group = open_root(session)
    group["atlas/colour"][0, 5, 5] = rng.integers(0, 256, 3)
    commit(session, "one texel")
    return figures((bytes_in(store) - before) / 1e3)


def _page(page: int, chunk: int, repeats: int, rng: Any) -> dict[str, Any]:
    """Write and commit one page: colour and provenance, and both with the state of Eq. 1 after a few views."""
    texels = page * page
    state = BlendState.empty(texels)
    for view in range(VIEWS):
        distance = rng.integers(0, 7500, texels)
        rgb = rng.integers(0, 256, (texels, 3), dtype=np.uint8)
        add_views(state, np.arange(texels), distance, np.ones(texels, bool), np.full(texels, view), rgb)
    result = [rng.integers(0, 256, (texels, 3), dtype=np.uint8), rng.integers(0, 5, texels, dtype=np.uint8)]
    figured = {}
    for name, arrays in {"colour_provenance": result, "with_blend_state": [*result, *state]}.items():
        flat = [a.reshape(page, page, *a.shape[1:]) for a in arrays]
        with tempfile.TemporaryDirectory() as folder:
            times = [_write_page(Path(folder) / str(i), flat, chunk) for i in range(repeats)]
            figured[name] = {
                "seconds": figures(statistics.median(times)),
                "bytes_per_texel": sum(a.nbytes for a in flat) / texels,
                "stored_mb": figures(bytes_in(Path(folder)) / repeats / 1e6),
            }
    ratio = figured["with_blend_state"]["seconds"] / figured["colour_provenance"]["seconds"]
    return {"texels": page, **figured, "seconds_ratio": figures(ratio)}


def _write_page(store: Path, arrays: list[np.ndarray], chunk: int) -> float:
    repository = open_repository(store, create=True)
    session = repository.writable_session("main")
    group = new_root(session)
    targets = [
        group.create_array(str(i), shape=a.shape, chunks=(chunk, chunk, *a.shape[2:]), dtype=a.dtype)
        for i, a in enumerate(arrays)
    ]
    start = time.perf_counter()
    for target, array in zip(targets, arrays, strict=True):
        target[:] = array
    commit(session, "page")
    return time.perf_counter() - start
