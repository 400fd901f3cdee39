"""Numbers by chance for cells of a lattice: hashes that kernels work out where they need them."""

from __future__ import annotations

import numpy as np

from facade_core.core.numba_cache import njit

COLUMN_FACTOR, ROW_FACTOR = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xC2B2AE3D27D4EB4F)
SEED_FACTOR, _MIX = np.uint64(0x165667B19E3779F9), np.uint64(0xD6E8FEB86659FD93)


@njit(cache=True, inline="always")
def hash_bits(h: np.uint64) -> np.uint64:
    """40 bits by chance."""
    return ((h ^ (h >> np.uint64(32))) * _MIX) >> np.uint64(24)


@njit(cache=True, inline="always")
def hash_to_uniform(h: np.uint64) -> float:
    """A number in 0..1 by chance."""
    h = (h ^ (h >> np.uint64(32))) * _MIX
    return np.float64(np.int64(h >> np.uint64(40))) * (1.0 / 16777216.0)


@njit(cache=True, inline="always")
def hash_row(y: float, seed: np.uint64) -> np.uint64:
    """A row of cells, to which columns times ACROSS are added."""
    return (np.uint64(np.int64(y)) + seed) * ROW_FACTOR


@njit(cache=True, inline="always")
def hash_uniform(x: int, seed: int) -> float:
    """A number in 0..1 by chance for a number."""
    return hash_to_uniform(np.uint64(x) * COLUMN_FACTOR + np.uint64(seed) * SEED_FACTOR)
