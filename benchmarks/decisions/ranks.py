"""0019: one array that the last writer wins, against sources kept apart and resolved by rank."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.timing import figures, seconds
from facade_core.core.provenance import Provenance, resolve

# Share of texels that each source covers, independent of the others.
COVER = {Provenance.PHOTO: 0.3, Provenance.INPAINTED: 0.2, Provenance.SYNTHESISED: 0.5, Provenance.TRANSLATED: 0.7}
# A facade may be done again after its street, as when its photo is replaced.
ORDERS = ("facade street", "street facade", "facade street facade", "street facade street")


def measure(quick: bool, data: Path | None) -> dict[str, Any]:
    """Texels whose colour depends on the order in which the stages finish, and what keeping sources apart costs."""
    side, repeats = (128, 1) if quick else (2048, 5)
    rng = np.random.default_rng(0)
    covers = {rank: rng.random((side, side)) < share for rank, share in COVER.items()}
    seeded = [
        np.where(covers[rank], rank, Provenance.UNSEEN)
        for rank in (Provenance.PHOTO, Provenance.INPAINTED, Provenance.SYNTHESISED)
    ]
    sources = {
        "facade": (rng.integers(0, 256, (side, side, 3), dtype=np.uint8), np.max(seeded, axis=0).astype(np.uint8)),
        "street": (
            rng.integers(0, 256, (side, side, 3), dtype=np.uint8),
            covers[Provenance.TRANSLATED].astype(np.uint16),
        ),
    }
    one = [_last_writer(sources, order.split()) for order in ORDERS]
    apart = [_by_rank(sources, order.split()) for order in ORDERS]
    resolving = seconds(lambda: resolve(*sources["facade"], *sources["street"]), repeats)
    kept = sum(array.itemsize * array[0, 0].size for pair in sources.values() for array in pair)
    return {
        "texels": side,
        "orders": len(ORDERS),
        "texels_that_depend_on_the_order": {"last_writer": _unsettled(one), "by_rank": _unsettled(apart)},
        "resolve_seconds": figures(resolving),
        "bytes_per_texel": {"last_writer": 4, "by_rank": 4 + kept},
    }


def _last_writer(sources: dict[str, tuple[np.ndarray, np.ndarray]], order: list[str]) -> np.ndarray:
    colour = np.zeros_like(sources["facade"][0])
    for stage in order:
        written, evidence = sources[stage]
        colour[evidence > Provenance.UNSEEN] = written[evidence > Provenance.UNSEEN]
    return colour


def _by_rank(sources: dict[str, tuple[np.ndarray, np.ndarray]], order: list[str]) -> np.ndarray:
    """Each stage writes its own arrays, and colour is resolved after each."""
    held = {stage: tuple(np.zeros_like(array) for array in pair) for stage, pair in sources.items()}
    colour = np.zeros_like(sources["facade"][0])
    for stage in order:
        held[stage] = sources[stage]
        colour = resolve(*held["facade"], *held["street"])[0]
    return colour


def _unsettled(colours: list[np.ndarray]) -> float:
    """Share of texels that are not the same in all colours."""
    different = [(one != two).any(axis=2) for one, two in itertools.pairwise(colours)]
    return figures(float(np.any(different, axis=0).mean()))
