"""The kernel of the ground: carriageway along centrelines, kerbs, and paving beyond."""

from __future__ import annotations

import numpy as np
from numba import njit

from facade_core.street.centrelines import Lines, distances
from facade_core.street.materials import ASPHALT, CARRIAGEWAY_M, KERB_M, PAVING, asphalt, paving

# A kerb's own grey, as it adds to what is under it, and the share that it takes from that.
KERB, KERB_TAKES = 112.5, 0.75


@njit(cache=True, inline="always")
def level(value: float) -> np.uint8:
    """A tone as a byte."""
    return np.uint8(np.int64(min(max(value, 0.0), 255.0) + 0.5))


@njit(cache=True, nogil=True, error_model="numpy")
def soil(
    x: np.ndarray,
    y: np.ndarray,
    side: np.ndarray,
    lines: Lines,
    seed: int,
    light: np.ndarray,
    grey: float,
    road: np.ndarray,
    slabs: np.ndarray,
    aside: np.ndarray,
    out: np.ndarray,
) -> None:
    """Ground: carriageway, kerb on its edge, paving beyond, each by its share of the footprint across the street.

    road, slabs, aside (n,): what is known here is written to them.
    """
    n = len(x)
    low, high = np.inf, -np.inf
    distances(x, y, lines, aside)
    widest = 2 * (lines.reach - CARRIAGEWAY_M - KERB_M)
    for k in range(n):
        reach = 0.5 * min(side[k], widest)
        low, high = min(low, aside[k] - reach), max(high, aside[k] + reach)
    if low < CARRIAGEWAY_M:
        asphalt(x, y, aside, side, seed, road)
    if high > CARRIAGEWAY_M:
        paving(x, y, side, seed, slabs)
    for k in range(n):
        wide = min(side[k], widest)
        low, high = aside[k] - 0.5 * wide, aside[k] + 0.5 * wide
        # shares of the road, of its half of the kerb and of the pavement's
        left = max(min(high, CARRIAGEWAY_M) - low, 0.0) / wide
        inner = max(min(high, CARRIAGEWAY_M) - max(low, CARRIAGEWAY_M - KERB_M), 0.0) / wide
        outer = max(min(high, CARRIAGEWAY_M + KERB_M) - max(low, CARRIAGEWAY_M), 0.0) / wide
        kerb = KERB * (inner + outer)
        first = (left - KERB_TAKES * inner) * road[k] if left > 0 else 0.0
        second = (1 - left - KERB_TAKES * outer) * slabs[k] if left < 1 else 0.0
        for band in range(3):
            value = kerb + first * ASPHALT[band] + second * PAVING[band]
            out[k, band] = level(value * grey * light[k])
