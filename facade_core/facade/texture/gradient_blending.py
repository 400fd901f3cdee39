"""Gradient-domain blending: offsets of cloned pixels that make seams and the rim of a hole invisible."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Int32Array
from facade_core.core.numba_cache import njit
from facade_core.facade.texture.settings import BLENDING

# Decimals of coarse offsets, grey levels.
_DECIMALS = 6


def solve_colour_offsets(
    wanted_right: Float32Array, wanted_below: Float32Array, hidden: BoolArray, region: Int32Array
) -> Float32Array:
    """Solve for the offsets of cloned pixels by least squares on the wanted steps, smooth within regions.

    Parameters
    ----------
    wanted_right : (H, W, 3) step to the right neighbour that makes the join invisible; 0 inside a region, NaN without
        join.
    wanted_below : (H, W, 3) the same downwards.
    hidden : (H, W) bool pixels with an offset.
    region : (H, W) int32 index of the part that was cloned as one.

    Returns
    -------
    (H, W, 3) float32, 0 outside `hidden`.
    """
    weight_right, step_right = _step_weights(wanted_right, hidden, 1)
    weight_below, step_below = _step_weights(wanted_below, hidden, 0)
    offset = _solve_coarse(weight_right, weight_below, step_right, step_below, hidden, region)
    _relax_offsets(
        offset,
        weight_right,
        weight_below,
        step_right,
        step_below,
        hidden,
        BLENDING.sweeps,
        np.float32(BLENDING.over_relaxation),
        np.float32(BLENDING.self_weight),
    )
    return offset


def _step_weights(wanted: Float32Array, hidden: BoolArray, axis: int) -> tuple[Float32Array, Float32Array]:
    joined = np.isfinite(wanted[..., 0])
    touched = hidden.copy()
    if axis:
        touched[:, :-1] |= hidden[:, 1:]
        touched[:, -1] = False
    else:
        touched[:-1] |= hidden[1:]
        touched[-1] = False
    step = np.where(joined[..., None], wanted, 0.0).astype(np.float32)
    size = np.abs(step).mean(2)
    return np.where(joined & touched, 1.0 / (1.0 + (size / BLENDING.half_weight_step) ** 2), 0.0).astype(
        np.float32
    ), step


def _solve_coarse(
    weight_right: Float32Array, weight_below: Float32Array, step_right: Float32Array, step_below: Float32Array,
    hidden: BoolArray, region: Int32Array,
) -> Float32Array:  # fmt: skip
    """Solve with one unknown for each block of pixels of one region."""
    from scipy import sparse
    from scipy.sparse.linalg import splu

    height, width = hidden.shape
    block = max(2, int(np.ceil(np.sqrt(hidden.sum() / BLENDING.max_coarse_unknowns))))
    y, x = np.nonzero(hidden)
    cell = (y // block).astype(np.int64) * (width // block + 1) + x // block
    _, number = np.unique(np.stack([cell, region[y, x]], 1), axis=0, return_inverse=True)
    number = number.reshape(-1)
    count = int(number.max()) + 1
    node = np.full((height, width), -1, np.int64)
    node[y, x] = number
    rows, columns, values = (
        [np.arange(count)],
        [np.arange(count)],
        [np.bincount(number, minlength=count) * BLENDING.self_weight],
    )
    right = np.zeros((count, 3))
    for weight, step, here, there in (
        (weight_right, step_right, np.s_[:, :-1], np.s_[:, 1:]),
        (weight_below, step_below, np.s_[:-1], np.s_[1:]),
    ):
        w = weight[here]
        used = (w > 0) & (node[here] != node[there])
        a, b, w, s = node[here][used], node[there][used], w[used].astype(float), step[here][used].astype(float)
        for p, q, sign in ((a, b, -1.0), (b, a, 1.0)):
            inside = p >= 0
            rows.append(p[inside])
            columns.append(p[inside])
            values.append(w[inside])
            for c in range(3):
                right[:, c] += np.bincount(p[inside], sign * (w * s[:, c])[inside], count)
            both = inside & (q >= 0)
            rows.append(p[both])
            columns.append(q[both])
            values.append(-w[both])
    matrix = sparse.csc_matrix(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), (count, count)
    )
    # SuperLU calls BLAS, whose rounding depends on the processor
    solved = np.round(splu(matrix).solve(right), _DECIMALS)
    offset = np.zeros((height, width, 3), np.float32)
    offset[y, x] = solved[number]
    return offset


@njit(cache=True)
def _relax_offsets(
    offset: Float32Array,
    weight_right: Float32Array,
    weight_below: Float32Array,
    step_right: Float32Array,
    step_below: Float32Array,
    hidden: BoolArray,
    sweeps: int,
    over: np.float32,
    leak: np.float32,
) -> None:
    """Relax by successive over-relaxation, in alternating directions."""
    height, width = hidden.shape
    for sweep in range(sweeps):
        for i in range(height):
            y = i if sweep % 2 == 0 else height - 1 - i
            for j in range(width):
                x = j if sweep % 2 == 0 else width - 1 - j
                if not hidden[y, x]:
                    continue
                east = weight_right[y, x] if x + 1 < width else np.float32(0)
                west = weight_right[y, x - 1] if x > 0 else np.float32(0)
                south = weight_below[y, x] if y + 1 < height else np.float32(0)
                north = weight_below[y - 1, x] if y > 0 else np.float32(0)
                total = east + west + south + north + leak
                for c in range(3):
                    s = np.float32(0)
                    if east > 0:
                        s += east * (offset[y, x + 1, c] - step_right[y, x, c])
                    if west > 0:
                        s += west * (offset[y, x - 1, c] + step_right[y, x - 1, c])
                    if south > 0:
                        s += south * (offset[y + 1, x, c] - step_below[y, x, c])
                    if north > 0:
                        s += north * (offset[y - 1, x, c] + step_below[y - 1, x, c])
                    offset[y, x, c] += over * (s / total - offset[y, x, c])
