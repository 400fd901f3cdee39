"""Joints, noise and piece tones of materials, averaged over footprints.

Joints, seams and edges count by the share of the footprint that they cover, the integral of their box. Lattice noise
and the tones of slabs, tiles and boards are integrated too and fade over footprints of several cells, so that nothing
aliases. Arrays are (n,), in branch-free loops that vectorise; lengths are metres; a footprint is the side of a square,
greater than 0.
"""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Float64Array
from facade_core.core.hash_uniform import COLUMN_FACTOR, ROW_FACTOR, SEED_FACTOR, hash_cell_row, hash_to_uniform
from facade_core.core.numba_cache import njit


@njit(cache=True, inline="always")
def _smoothstep_integral(middle: float, length: float) -> float:
    """Integrate 3 t^2 - 2 t^3 over an interval inside 0..1, exactly."""
    return length * (middle * middle * (3 - 2 * middle) + 0.25 * length * length * (1 - 2 * middle))


@njit(cache=True, inline="always", error_model="numpy")
def _lattice_noise(x: float, y: float, wide: float, high: float, seed: np.uint64) -> float:
    """Average lattice noise in -0.5..0.5 over a box about x, y, in cells.

    A box of more than one cell counts as one and fades until two.
    """
    fade = min(max(2.0 - max(wide, high), 0.0), 1.0)
    wide, high = min(wide, 1.0), min(high, 1.0)
    x0, y0 = np.floor(x - 0.5 * wide), np.floor(y - 0.5 * high)
    # parts of the box in its first cell and in the next
    right, below = max(x + 0.5 * wide - x0 - 1, 0.0), max(y + 0.5 * high - y0 - 1, 0.0)
    left, above = wide - right, high - below
    rise, fall = _smoothstep_integral(x - 0.5 * wide - x0 + 0.5 * left, left), _smoothstep_integral(0.5 * right, right)
    u0, u1, u2 = left - rise, rise + right - fall, fall
    rise, fall = (
        _smoothstep_integral(y - 0.5 * high - y0 + 0.5 * above, above),
        _smoothstep_integral(0.5 * below, below),
    )
    v0, v1, v2 = above - rise, rise + below - fall, fall
    a0, b0 = np.uint64(np.int64(x0)) * COLUMN_FACTOR, hash_cell_row(y0, seed)
    a1, b1 = a0 + COLUMN_FACTOR, b0 + ROW_FACTOR
    a2, b2 = a1 + COLUMN_FACTOR, b1 + ROW_FACTOR
    total = v0 * (u0 * hash_to_uniform(a0 + b0) + u1 * hash_to_uniform(a1 + b0) + u2 * hash_to_uniform(a2 + b0))
    total += v1 * (u0 * hash_to_uniform(a0 + b1) + u1 * hash_to_uniform(a1 + b1) + u2 * hash_to_uniform(a2 + b1))
    total += v2 * (u0 * hash_to_uniform(a0 + b2) + u1 * hash_to_uniform(a1 + b2) + u2 * hash_to_uniform(a2 + b2))
    noise: float = fade * (total / (wide * high) - 0.5)
    return noise


@njit(cache=True, forceinline=True, error_model="numpy")
def stripe_share(position: float, wide: float, first: float, width: float) -> float:
    """Return the share of an interval on unit-spaced stripes.

    Parameters
    ----------
    position, wide : middle and width of the interval.
    first, width : start and width of the stripes.
    """
    low, high = position - 0.5 * wide - first, position + 0.5 * wide - first
    start, end = np.floor(low), np.floor(high)
    share: float = ((end - start) * width + min(high - end, width) - min(low - start, width)) / wide
    return share


@njit(cache=True, forceinline=True, error_model="numpy")
def running_bond_stone_share(
    column: float, row: float, wide: float, high: float, joint: float, across: float, down: float
) -> float:
    """Return the share of a footprint on the stones of a running bond, off its joints.

    Odd courses shift by half a stone.

    Parameters
    ----------
    column, row : place, in stones.
    wide, high : footprint, in stones.
    joint : width of a joint, metres.
    across, down : stones per metre.
    """
    half_across, half_down = 0.5 * joint * across, 0.5 * joint * down
    even = stripe_share(0.5 * row, 0.5 * high, 0.5 * half_down, 0.5 - half_down)
    odd = stripe_share(0.5 * row, 0.5 * high, 0.5 + 0.5 * half_down, 0.5 - half_down)
    clear = even * stripe_share(column, wide, half_across, 1 - 2 * half_across)
    share: float = clear + odd * stripe_share(column, wide, 0.5 + half_across, 1 - 2 * half_across)
    return share


@njit(cache=True, nogil=True, error_model="numpy")
def add_noise(
    x: Float64Array,
    y: Float64Array,
    side: Float64Array,
    cell: tuple[float, float],
    weight: float,
    seed: int,
    out: Float64Array,
) -> None:
    """Add weighted lattice noise in -1..1 to `out`.

    Parameters
    ----------
    x, y : (n,) coordinates, metres.
    side : (n,) footprints, metres.
    cell : width and height of a noise cell, metres.
    weight : factor.
    seed : random seed.
    out : (n,) tones, changed in place.
    """
    across, down, row_seed = 1 / cell[0], 1 / cell[1], np.uint64(seed) * SEED_FACTOR
    for k in range(len(x)):
        out[k] += 2 * weight * _lattice_noise(x[k] * across, y[k] * down, side[k] * across, side[k] * down, row_seed)


@njit(cache=True, nogil=True, error_model="numpy")
def add_piece_tones(
    x: Float64Array,
    y: Float64Array,
    side: Float64Array,
    cell: tuple[float, float],
    weight: float,
    seed: int,
    out: Float64Array,
) -> None:
    """Add weighted piece tones in -0.5..0.5 of slabs, tiles or boards.

    Odd rows shift by half a piece. A footprint of more than one piece counts as one and fades until two.

    Parameters
    ----------
    x, y : (n,) coordinates, metres.
    side : (n,) footprints, metres.
    cell : width and height of a piece, metres.
    weight : factor.
    seed : random seed.
    out : (n,) tones, changed in place.
    """
    across, down, row_seed = 1 / cell[0], 1 / cell[1], np.uint64(seed) * SEED_FACTOR
    for k in range(len(x)):
        wide, high = side[k] * across, side[k] * down
        fade = min(max(2.0 - max(wide, high), 0.0), 1.0)
        wide, high = min(wide, 1.0), min(high, 1.0)
        left, top = x[k] * across - 0.5 * wide, y[k] * down - 0.5 * high
        y0 = np.floor(top)
        lower = max(top + high - y0 - 1, 0.0) / high
        odd = np.float64(np.int64(y0) & 1)
        x0, x1 = np.floor(left + 0.5 * odd), np.floor(left + 0.5 - 0.5 * odd)
        next_share = max(left + 0.5 * odd + wide - x0 - 1, 0.0) / wide
        next_share_below = max(left + 0.5 - 0.5 * odd + wide - x1 - 1, 0.0) / wide
        a, b = (
            np.uint64(np.int64(x0)) * COLUMN_FACTOR + hash_cell_row(y0, row_seed),
            np.uint64(np.int64(x1)) * COLUMN_FACTOR + hash_cell_row(y0 + 1, row_seed),
        )
        upper = (1 - next_share) * hash_to_uniform(a) + next_share * hash_to_uniform(a + COLUMN_FACTOR)
        tone = (1 - lower) * upper + lower * (
            (1 - next_share_below) * hash_to_uniform(b) + next_share_below * hash_to_uniform(b + COLUMN_FACTOR)
        )
        out[k] += weight * fade * (tone - 0.5)
