"""Iterated conditional modes on Eq. 1 of AlSisan & Mitra 2012, of which only what a move changed is computed again.

The greedy uniform rectangles of a type split into its connected parts: a rectangle lies in one part, and which part's is taken
first changes none of another's. So moving a cell changes the rectangles of the parts that it leaves and joins, no others. Their
reciprocal sizes are summed as whole numbers of 2^-40, in any order the same.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from facade_core.core.numba_cache import njit

# What a rectangle of one cell adds to the sum of reciprocal sizes.
WHOLE = 1 << 40
# A move that lowers the energy by less is none.
_LEAST = -1e-9


class Moves(NamedTuple):
    """What is known of a labelling of T types, kept from move to move and from weight to weight.

    x (R + 2, C + 2) int32: the types, -1 where there is no element and all around; number (T,): cells of each type; sums (T,):
    of their rectangles' reciprocal sizes; known (cells,) bool: whether the next two hold; left (cells,): what the sum of a
    cell's type changes by when the cell leaves it; joined (cells, 4): what that of the type above, below, left and right of
    it changes by when it joins; merges (T, T) bool, merged (T, T): what the sums of two types change by when they become one,
    and whether that holds. Cells are those of x in reading order; sums are int64, in 1 / WHOLE.
    """

    x: np.ndarray
    number: np.ndarray
    sums: np.ndarray
    known: np.ndarray
    left: np.ndarray
    joined: np.ndarray
    merges: np.ndarray
    merged: np.ndarray

    @property
    def labels(self) -> np.ndarray:
        """(R, C) int32 types, -1 where there is no element."""
        return self.x[1:-1, 1:-1].copy()


def moves_from(labels: np.ndarray, types: int) -> Moves:
    """What is known of a labelling (R, C), -1 where there is no element, of `types` types, before any move."""
    x = np.pad(labels.astype(np.int32), 1, constant_values=-1)
    sums = np.array([rectangles(x == t) for t in range(types)], np.int64)
    return Moves(
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
def rectangles(cells: np.ndarray) -> int:
    """Sum of WHOLE / size over the rectangles of (R, C) bool cells: biggest first, none overlapping, first found on ties."""
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
        total += (WHOLE + best // 2) // best
        for r in range(top, bottom + 1):
            for c in range(left, right + 1):
                free[r, c] = False


@njit(cache=True)
def _parts(x: np.ndarray, at: int, label: int, found: np.ndarray) -> None:
    """Makes found (R, C) bool the connected parts of `label` that the cell `at` is in or beside, and that cell."""
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
            near = _beside(cell, k, width)
            if types[near] == label and not cells[near]:
                cells[near] = True
                waiting[number] = near
                number += 1


@njit(cache=True)
def _beside(cell: int, k: int, width: int) -> int:
    """The cell above, below, left or right of one."""
    if k < 2:
        return cell + (2 * k - 1) * width
    return cell + 2 * k - 5


@njit(cache=True)
def _learn(of: Moves, at: int) -> None:
    """Fills in what a cell's moves change."""
    types = of.x.reshape(-1)
    own = types[at]
    width = of.x.shape[1]
    part = np.empty(of.x.shape, np.bool_)
    for k in range(5):
        label = own if k == 4 else types[_beside(at, k, width)]
        if k < 4 and (label < 0 or label == own):
            continue
        _parts(of.x, at, label, part)
        with_it = rectangles(part)
        part.reshape(-1)[at] = False
        change = with_it - rectangles(part)
        if k == 4:
            of.left[at] = -change
        else:
            of.joined[at, k] = change
    of.known[at] = True


@njit(cache=True)
def _forget(of: Moves, part: np.ndarray, label: int) -> None:
    """What is in a part (R, C) bool of a type or beside it, and how the type merges, has to be learnt again."""
    cells = part.reshape(-1)
    for cell in range(cells.size):
        if cells[cell]:
            of.known[cell] = False
            for k in range(4):
                of.known[_beside(cell, k, part.shape[1])] = False
    for t in range(len(of.number)):
        of.merges[label, t] = of.merges[t, label] = False


@njit(cache=True)
def _move_cells(
    of: Moves, previous: np.ndarray, cost: np.ndarray, alpha: float, energies: np.ndarray, moves: int
) -> int:
    """One sweep: each cell to the type that lowers the energy most. Returns the number of moves so far."""
    count = of.number
    types, before = of.x.reshape(-1), previous.reshape(-1)
    width = of.x.shape[1]
    part = np.empty(of.x.shape, np.bool_)
    joined = np.full(len(count), WHOLE)
    for at in range(types.size):
        a, p = types[at], before[at]
        if a < 0:
            continue
        if not of.known[at]:
            _learn(of, at)
        joined[:] = WHOLE
        for k in range(4):
            label = types[_beside(at, k, width)]
            if label >= 0 and label != a:
                joined[label] = of.joined[at, k]
        loss = of.left[at] / WHOLE - 1 - 1 / count[a]
        if count[a] > 1:
            loss += 1 + 1 / (count[a] - 1)
        best, gain = a, _LEAST
        for b in range(len(count)):
            if b == a or count[b] == 0:
                continue
            change = 1 / (count[b] + 1) - 1 / count[b] + joined[b] / WHOLE + loss
            here = cost[p, b] - cost[p, a] + alpha * change
            if here < gain:
                best, gain = b, here
        if best == a:
            continue
        of.sums[a] += of.left[at]
        of.sums[best] += joined[best]
        count[a] -= 1
        count[best] += 1
        _parts(of.x, at, a, part)
        _forget(of, part, a)
        _parts(of.x, at, best, part)
        _forget(of, part, best)
        types[at] = best
        moves += 1
        energies[moves] = energies[moves - 1] + gain
    return moves


@njit(cache=True)
def _merge_types(of: Moves, previous: np.ndarray, cost: np.ndarray, alpha: float) -> float:
    """Makes one type of the two whose union lowers the energy most; returns what it changes, 0 where none does."""
    count, number = of.number, len(of.number)
    types, before = of.x.reshape(-1), previous.reshape(-1)
    width = of.x.shape[1]
    data = np.zeros((number, number))
    touch = np.zeros((number, number), np.bool_)
    part = np.empty(of.x.shape, np.bool_)
    cells = part.reshape(-1)
    for at in range(types.size):
        a = types[at]
        if a < 0:
            continue
        for b in range(number):
            data[a, b] += cost[before[at], b] - cost[before[at], a]
        for k in range(4):
            near = types[_beside(at, k, width)]
            if near >= 0:
                touch[a, near] = True
    best_from, best_to, best = -1, -1, _LEAST
    for a in range(number):
        for b in range(number):
            if a == b or count[a] == 0 or count[b] == 0:
                continue
            if not of.merges[a, b]:
                change = 0
                if touch[a, b]:
                    for at in range(types.size):
                        cells[at] = types[at] == a or types[at] == b
                    change = rectangles(part) - of.sums[a] - of.sums[b]
                of.merged[a, b] = of.merged[b, a] = change
                of.merges[a, b] = of.merges[b, a] = True
            regular = 1 / (count[a] + count[b]) - 1 - 1 / count[a] - 1 / count[b] + of.merged[a, b] / WHOLE
            gain = data[a, b] + alpha * regular
            if gain < best:
                best_from, best_to, best = a, b, gain
    if best_from < 0:
        return 0.0
    for at in range(types.size):
        cells[at] = types[at] == best_from or types[at] == best_to
        if types[at] == best_from:
            types[at] = best_to
    of.sums[best_to] += of.sums[best_from] + of.merged[best_from, best_to]
    of.sums[best_from] = 0
    count[best_to] += count[best_from]
    count[best_from] = 0
    _forget(of, part, best_from)
    _forget(of, part, best_to)
    return best


@njit(cache=True)
def icm(of: Moves, cost: np.ndarray, alpha: float) -> np.ndarray:
    """Lowers Eq. 1 from a labelling, which is also what the data term compares with, and returns the energy after each
    accepted move, the start first.

    Single cells move first; when none can, all cells of a type move at once to another one in use. Every accepted move
    lowers the energy, so both loops end.
    """
    previous = of.x.copy()
    types = len(of.number)
    regular = 0.0
    for t in range(types):
        if of.number[t]:
            regular += 1 + 1 / of.number[t] + of.sums[t] / WHOLE
    energies = np.empty(64 + 16 * previous.size)
    energies[0] = alpha * regular
    moves = 0
    while moves < energies.size - previous.size - types - 1:
        before = moves
        moves = _move_cells(of, previous, cost, alpha, energies, moves)
        if moves > before:
            continue
        gain = _merge_types(of, previous, cost, alpha)
        if gain == 0.0:
            break
        moves += 1
        energies[moves] = energies[moves - 1] + gain
    return energies[: moves + 1]
