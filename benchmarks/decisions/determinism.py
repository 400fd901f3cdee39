"""0018: what the order of views, the number of threads and a shared generator would do to the bits."""

from __future__ import annotations

import hashlib
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import zarr

from benchmarks.timing import figures, seconds
from facade_core.atlas.rasters import chunk_digests
from facade_core.core.atlas_spec import AtlasSpec
from facade_core.geometry.chart_packing import pack
from facade_core.street.propagation.blend import BlendState, add_views, blend

SHUFFLES = 8


def measure(quick: bool, data: Path | None) -> dict[str, Any]:
    """Texels that change with the order of their views, votes that change with threads, and the cost of the digests."""
    texels, views, page = (2_000, 5, 256) if quick else (200_000, 12, 2048)
    return {
        "views_in_any_order": _orders(texels, views),
        "forest_by_threads": _threads(2_000 if quick else 40_000),
        "digests_of_a_page": _digests(page, 1 if quick else 5),
    }


def _orders(texels: int, views: int) -> dict[str, Any]:
    """The same views in shuffled orders: the shipped integer state, and running means in float32 of the same weights."""
    rng = np.random.default_rng(0)
    distance = rng.integers(0, 7500, (views, texels))
    rgb = rng.integers(0, 256, (views, texels, 3), dtype=np.uint8)
    exact, running = set(), []
    for _ in range(SHUFFLES):
        order = rng.permutation(views)
        state = BlendState.empty(texels)
        mean, weights = np.zeros((texels, 3), np.float32), np.zeros((texels, 1), np.float32)
        for view in order:
            everything = (np.arange(texels), distance[view], np.ones(texels, bool), np.full(texels, view), rgb[view])
            add_views(state, *everything)
            weight = (1 - distance[view] / np.float32(7500)).astype(np.float32)[:, None]
            weights += weight
            mean += (rgb[view] - mean) * (weight / np.maximum(weights, np.float32(1e-9)))
        exact.add(hashlib.blake2b(blend(state)[0].tobytes()).hexdigest())
        running.append(np.rint(mean).astype(np.uint8))
    changed = np.any([(one != running[0]).any(axis=1) for one in running], axis=0)
    return {
        "texels": texels,
        "views": views,
        "orders": SHUFFLES,
        "digests_of_integer_state": len(exact),
        "digests_of_running_mean": len({hashlib.blake2b(one.tobytes()).hexdigest() for one in running}),
        "texels_changed_by_running_mean": figures(float(changed.mean())),
    }


def _threads(rows: int) -> dict[str, Any]:
    """The shipped forest on one, two and four intra-op threads: seconds, and whether the bits are the same."""
    import onnxruntime
    from facade_core.parsing.forest import SHIPPED

    results, times = [], {}
    for threads in (1, 2, 4):
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        session = onnxruntime.InferenceSession(str(SHIPPED), options, providers=["CPUExecutionProvider"])
        rng = np.random.default_rng(0)
        feed = {node.name: rng.random((rows, node.shape[1]), dtype=np.float32) for node in session.get_inputs()}
        start = time.perf_counter()
        results.append(np.concatenate([votes.reshape(-1) for votes in session.run(None, feed)]))
        times[str(threads)] = figures(time.perf_counter() - start)
    return {
        "rows": rows,
        "seconds_by_threads": times,
        "votes_that_differ_from_one_thread": {
            str(n): figures(float((votes != results[0]).mean())) for n, votes in zip((2, 4), results[1:], strict=True)
        },
    }


def _digests(page: int, repeats: int) -> dict[str, Any]:
    """Digesting every chunk of one page of colour and provenance, next to writing it (plain zarr)."""
    texels = np.array([[page - 4, page - 4]])
    placement = pack(texels, 1.0, np.array([0]), page=page, chunk=128, gutter=2)
    rng = np.random.default_rng(0)
    values = [rng.integers(0, 256, (1, page, page, *last), dtype=np.uint8) for last in ((3,), ())]
    with tempfile.TemporaryDirectory() as folder:
        group: Any = zarr.open_group(folder, mode="w")
        colour, provenance = (
            group.create_array(name, shape=v.shape, chunks=(1, 128, 128, *v.shape[3:]), dtype="uint8")
            for name, v in zip(("colour", "provenance"), values, strict=True)
        )

        def write() -> None:
            colour[:], provenance[:] = values

        writing = seconds(write, repeats)
        digest = seconds(
            lambda: chunk_digests(colour, provenance, AtlasSpec(1, 20.0, page=page), placement, [0]), repeats
        )
    return {"texels": page, "write_seconds": figures(writing), "digest_seconds": figures(digest)}
