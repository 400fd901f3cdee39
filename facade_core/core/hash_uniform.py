"""Hash-based random numbers for lattice cells, computed inside kernels."""

from __future__ import annotations

import numpy as np

from facade_core.core.numba_cache import njit

# Odd 64-bit multipliers of the hash.
COLUMN_FACTOR = np.uint64(0x9E3779B97F4A7C15)
ROW_FACTOR = np.uint64(0xC2B2AE3D27D4EB4F)
SEED_FACTOR = np.uint64(0x165667B19E3779F9)
_MIX_FACTOR = np.uint64(0xD6E8FEB86659FD93)


@njit(cache=True, inline="always")
def hash_to_random_bits(h: np.uint64) -> np.uint64:
    """Return 40 pseudo-random bits of a hash."""
    return ((h ^ (h >> np.uint64(32))) * _MIX_FACTOR) >> np.uint64(24)


@njit(cache=True, inline="always")
def hash_to_uniform(h: np.uint64) -> float:
    """Return a pseudo-random number in [0, 1) of a hash."""
    h = (h ^ (h >> np.uint64(32))) * _MIX_FACTOR
    return np.float64(np.int64(h >> np.uint64(40))) * (1.0 / 16777216.0)


@njit(cache=True, inline="always")
def hash_cell_row(y: float, seed: np.uint64) -> np.uint64:
    """Return the hash of a lattice row's cells; add column * COLUMN_FACTOR for one cell."""
    return (np.uint64(np.int64(y)) + seed) * ROW_FACTOR


@njit(cache=True, inline="always")
def hash_uniform(x: int, seed: int) -> float:
    """Return a pseudo-random number in [0, 1) for an integer and a seed."""
    uniform: float = hash_to_uniform(np.uint64(x) * COLUMN_FACTOR + np.uint64(seed) * SEED_FACTOR)
    return uniform
