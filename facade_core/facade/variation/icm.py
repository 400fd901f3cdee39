"""Iterated conditional modes on Eq. 1, with incremental updates after each move.

The greedy uniform rectangles of a type split into its connected parts: a rectangle is within one part, and the
order of parts does not matter. Moving a cell therefore changes only the rectangles of the parts that it leaves
and joins. Their reciprocal sizes are summed as whole numbers of 2^-40, so that sums do not depend on the order.

References
----------
AlSisan & Mitra 2012, Eq. 1.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, Int32Array, Int64Array
from facade_core.core.numba_cache import njit

# Fixed-point one: the reciprocal size of a rectangle of one cell.
FIXED_POINT_ONE = 1 << 40
# Largest change of the energy by an accepted move.
_MAX_CHANGE = -1e-9
# Changes that differ by less are equal but for rounding, in shares of 1 + the weight of regularity; the first one is taken.
_TIE_SHARE = 1e-11


class IcmState(NamedTuple):
    """Labelling of T types with cached changes of its energy, kept from move to move and from weight to weight.

    Cells are numbered in reading order of `types`; sums are int64 in units of 1 / FIXED_POINT_ONE.

    Attributes
    ----------
    types : (R + 2, C + 2) int32 types, -1 without an element and all around.
    counts : (T,) cells of each type.
    reciprocal_sums : (T,) sum of reciprocal sizes of each type's rectangles.
    is_current : (cells,) bool, True if the next two hold.
    leave_change : (cells,) change of the sum of a cell's type when the cell leaves it.
    join_change : (cells, 4) change of the sum of the type above, below, left and right when the cell joins it.
    is_merge_current : (T, T) bool, True if the next holds.
    merge_change : (T, T) change of the sums of two types when they merge.
    """

    types: Int32Array
    counts: Int64Array
    reciprocal_sums: Int64Array
    is_current: BoolArray
    leave_change: Int64Array
    join_change: Int64Array
    is_merge_current: BoolArray
    merge_change: Int64Array

    @property
    def labels(self) -> Int32Array:
        """Return the (R, C) int32 types, -1 without an element."""
        return self.types[1:-1, 1:-1].copy()


def initial_icm_state(labels: Int32Array, types: int) -> IcmState:
    """Return the state before any move.

    Parameters
    ----------
    labels : (R, C) types, -1 without an element.
    types : number of types.
    """
    x = np.pad(labels.astype(np.int32), 1, constant_values=-1)
    sums = np.array([sum_reciprocal_rectangle_sizes(x == t) for t in range(types)], np.int64)
    return IcmState(
        x,
        np.bincount(labels[labels >= 0], minlength=types).astype(np.int64),
        sums,
        np.zeros(x.size, np.bool_),
        np.zeros(x.size, np.int64),
        np.zeros((x.size, 4), np.int64),
        np.zeros((types, types), np.bool_),
        np.zeros((types, types), np.int64),
    )


@njit(cache=True)
def sum_reciprocal_rectangle_sizes(cells: BoolArray) -> int:
    """Return the sum of FIXED_POINT_ONE / size over the disjoint rectangles of cells.

    Rectangles are taken greedily, the largest first, the first found on ties.

    Parameters
    ----------
    cells : (R, C) bool.
    """
    rows, columns = cells.shape
    free = cells.copy()
    height = np.zeros(columns, np.int64)
    total = 0
    while True:
        best = 0
        bottom = right = top = left = 0
        for c in range(columns):
            height[c] = 0
        for r in range(rows):
            for c in range(columns):
                if not free[r, c]:
                    height[c] = 0
                    continue
                height[c] += 1
                # Widen to the left while the run lasts and may still be bigger; the lowest column bounds the height.
                low = height[c]
                k = c
                while k >= 0 and height[k] > 0:
                    low = min(low, height[k])
                    if low * (c + 1) <= best:
                        break
                    size = low * (c - k + 1)
                    if size > best:
                        best, bottom, right, top, left = size, r, c, r - low + 1, k
                    k -= 1
        if best == 0:
            return total
        total += (FIXED_POINT_ONE + best // 2) // best
        for r in range(top, bottom + 1):
            for c in range(left, right + 1):
                free[r, c] = False


@njit(cache=True)
def _mark_parts(x: Int32Array, at: int, label: int, found: BoolArray) -> None:
    """Write to `found` (R, C) bool the connected parts of `label` that touch the cell `at`, and that cell."""
    types, cells = x.reshape(-1), found.reshape(-1)
    cells[:] = False
    cells[at] = True
    waiting = np.empty(x.size, np.int64)
    waiting[0] = at
    number = 1
    width = x.shape[1]
    while number:
        number -= 1
        cell = waiting[number]
        for k in range(4):
            near = _neighbour(cell, k, width)
            if types[near] == label and not cells[near]:
                cells[near] = True
                waiting[number] = near
                number += 1


@njit(cache=True)
def _neighbour(cell: int, k: int, width: int) -> int:
    """Return the cell above, below, left or right of a cell."""
    if k < 2:
        return cell + (2 * k - 1) * width
    return cell + 2 * k - 5


@njit(cache=True)
def _update_cell(state: IcmState, at: int) -> None:
    """Compute the changes of all moves of a cell."""
    types = state.types.reshape(-1)
    own = int(np.int64(types[at]))  # one integer type, so that callees are compiled once
    width = state.types.shape[1]
    part = np.empty(state.types.shape, np.bool_)
    for k in range(5):
        label = own if k == 4 else int(np.int64(types[_neighbour(at, k, width)]))
        if k < 4 and (label < 0 or label == own):
            continue
        _mark_parts(state.types, at, label, part)
        with_it = sum_reciprocal_rectangle_sizes(part)
        part.reshape(-1)[at] = False
        change = with_it - sum_reciprocal_rectangle_sizes(part)
        if k == 4:
            state.leave_change[at] = -change
        else:
            state.join_change[at, k] = change
    state.is_current[at] = True


@njit(cache=True)
def _invalidate(state: IcmState, part: BoolArray, label: int) -> None:
    """Mark the cells of a part and next to it, and the merges of its type, as not current."""
    cells = part.reshape(-1)
    for cell in range(cells.size):
        if cells[cell]:
            state.is_current[cell] = False
            for k in range(4):
                state.is_current[_neighbour(cell, k, part.shape[1])] = False
    for t in range(len(state.counts)):
        state.is_merge_current[label, t] = state.is_merge_current[t, label] = False


@njit(cache=True, inline="always")
def _move_cells(
    state: IcmState, previous: Int32Array, cost: Float64Array, alpha: float, energies: Float64Array, moves: int
) -> int:
    """Move each cell to the type that lowers the energy most; return the number of moves so far."""
    count = state.counts
    types, before = state.types.reshape(-1), previous.reshape(-1)
    width = state.types.shape[1]
    part = np.empty(state.types.shape, np.bool_)
    joined = np.full(len(count), FIXED_POINT_ONE)
    tie = _TIE_SHARE * (1 + alpha)
    for at in range(types.size):
        a, p = int(np.int64(types[at])), before[at]
        if a < 0:
            continue
        if not state.is_current[at]:
            _update_cell(state, at)
        joined[:] = FIXED_POINT_ONE
        for k in range(4):
            label = types[_neighbour(at, k, width)]
            if label >= 0 and label != a:
                joined[label] = state.join_change[at, k]
        loss = state.leave_change[at] / FIXED_POINT_ONE - 1 - 1 / count[a]
        if count[a] > 1:
            loss += 1 + 1 / (count[a] - 1)
        best, gain = a, _MAX_CHANGE
        for b in range(len(count)):
            if b == a or count[b] == 0:
                continue
            change = 1 / (count[b] + 1) - 1 / count[b] + joined[b] / FIXED_POINT_ONE + loss
            here = cost[p, b] - cost[p, a] + alpha * change
            if here < gain - tie:
                best, gain = b, here
        if best == a:
            continue
        state.reciprocal_sums[a] += state.leave_change[at]
        state.reciprocal_sums[best] += joined[best]
        count[a] -= 1
        count[best] += 1
        _mark_parts(state.types, at, a, part)
        _invalidate(state, part, a)
        _mark_parts(state.types, at, best, part)
        _invalidate(state, part, best)
        types[at] = best
        moves += 1
        energies[moves] = energies[moves - 1] + gain
    return moves


@njit(cache=True)
def _merge_types(state: IcmState, previous: Int32Array, cost: Float64Array, alpha: float) -> float:
    """Merge the two types whose union lowers the energy most; return the change, 0 if none does."""
    count, number = state.counts, len(state.counts)
    types, before = state.types.reshape(-1), previous.reshape(-1)
    width = state.types.shape[1]
    data = np.zeros((number, number))
    touch = np.zeros((number, number), np.bool_)
    part = np.empty(state.types.shape, np.bool_)
    cells = part.reshape(-1)
    for at in range(types.size):
        a = types[at]
        if a < 0:
            continue
        for b in range(number):
            data[a, b] += cost[before[at], b] - cost[before[at], a]
        for k in range(4):
            near = types[_neighbour(at, k, width)]
            if near >= 0:
                touch[a, near] = True
    best_from, best_to, best = -1, -1, _MAX_CHANGE
    tie = _TIE_SHARE * (types.size + alpha)
    for a in range(number):
        for b in range(number):
            if a == b or count[a] == 0 or count[b] == 0:
                continue
            if not state.is_merge_current[a, b]:
                change = 0
                if touch[a, b]:
                    for at in range(types.size):
                        cells[at] = types[at] == a or types[at] == b
                    change = sum_reciprocal_rectangle_sizes(part) - state.reciprocal_sums[a] - state.reciprocal_sums[b]
                state.merge_change[a, b] = state.merge_change[b, a] = change
                state.is_merge_current[a, b] = state.is_merge_current[b, a] = True
            regular = (
                1 / (count[a] + count[b]) - 1 - 1 / count[a] - 1 / count[b] + state.merge_change[a, b] / FIXED_POINT_ONE
            )
            gain = data[a, b] + alpha * regular
            if gain < best - tie:
                best_from, best_to, best = a, b, gain
    if best_from < 0:
        return 0.0
    for at in range(types.size):
        cells[at] = types[at] == best_from or types[at] == best_to
        if types[at] == best_from:
            types[at] = best_to
    state.reciprocal_sums[best_to] += state.reciprocal_sums[best_from] + state.merge_change[best_from, best_to]
    state.reciprocal_sums[best_from] = 0
    count[best_to] += count[best_from]
    count[best_from] = 0
    _invalidate(state, part, best_from)
    _invalidate(state, part, best_to)
    return best


@njit(cache=True)
def run_icm(state: IcmState, cost: Float64Array, alpha: float) -> Float64Array:
    """Lower Eq. 1 from a labelling, which is also the reference of the data term.

    Single cells move first; if none can, all cells of a type move to another type in use. Every accepted move lowers
    the energy, so both loops end.

    Parameters
    ----------
    state : labelling; changed in place.
    cost : (T, T) relabelling costs.
    alpha : weight of regularity.

    Returns
    -------
    (moves + 1,) energy at the start and after each accepted move.
    """
    previous = state.types.copy()
    types = len(state.counts)
    regular = 0.0
    for t in range(types):
        if state.counts[t]:
            regular += 1 + 1 / state.counts[t] + state.reciprocal_sums[t] / FIXED_POINT_ONE
    energies = np.empty(64 + 16 * previous.size)
    energies[0] = alpha * regular
    moves = 0
    while moves < energies.size - previous.size - types - 1:
        before = moves
        moves = _move_cells(state, previous, cost, alpha, energies, moves)
        if moves > before:
            continue
        gain = _merge_types(state, previous, cost, alpha)
        if gain == 0.0:
            break
        moves += 1
        energies[moves] = energies[moves - 1] + gain
    return energies[: moves + 1]
