"""Structure matrices and their hierarchy: the MRF of AlSisan & Mitra 2012, Eq. 1, solved by ICM."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facade_core.kernels import njit

# The weight alpha grows by _GROWTH from _ALPHA[0] to _ALPHA[1]; costs are normalised to [0, 1], regularity is not.
_ALPHA = (1e-3, 1e3)
_GROWTH = 2.6


@dataclass(frozen=True, slots=True, eq=False)
class Relaxation:
    """One weight's solution: labels like S0, and Eq. 1 after every accepted move, the start first."""

    alpha: float
    labels: np.ndarray
    energies: np.ndarray


def relax(structure: np.ndarray, cost: np.ndarray) -> list[Relaxation]:
    """Relabel a structure matrix with growing weight of regularity until one label remains.

    structure (R, C) int32: element types, -1 where the grid has no element; cost (T, T): of relabelling a as b.
    Each weight starts from the previous solution, which is also what its data term compares with. Returns a solution
    per weight; the last one has a single label: the type that is cheapest for all, should ICM have stopped before.
    """
    current = np.ascontiguousarray(structure, np.int32)
    cost = np.ascontiguousarray(cost, np.float64)
    found: list[Relaxation] = []
    alpha = _ALPHA[0]
    while _distinct(current) > 1 and alpha <= _ALPHA[1]:
        labels, energies, moves = _icm(current, cost, alpha)
        found.append(Relaxation(alpha, labels, energies[: moves + 1]))
        current = labels
        alpha *= _GROWTH
    if _distinct(current) > 1:
        used = current[current >= 0]
        present = np.unique(used)
        cheapest = present[np.argmin(cost[np.ix_(used, present)].sum(axis=0))]
        found.append(Relaxation(np.inf, np.where(current >= 0, cheapest, current).astype(np.int32), np.zeros(0)))
    return found


def regularity(structure: np.ndarray) -> tuple[float, float, float]:
    """The three terms of E_reg: number of types, sum of reciprocal repeats, sum of reciprocal sub-rectangle sizes."""
    labels = np.ascontiguousarray(structure, np.int32)
    counts = np.unique(labels[labels >= 0], return_counts=True)
    rectangles = sum(_rectangles(labels, label) for label in counts[0])
    return float(len(counts[0])), float((1 / counts[1]).sum()), float(rectangles)


def _distinct(labels: np.ndarray) -> int:
    return len(np.unique(labels[labels >= 0]))


@njit(cache=True)
def _rectangles(labels: np.ndarray, label: int) -> float:
    """Sum of 1/size over the uniform rectangles of one label: biggest first, none overlapping, first found on ties.

    Rectangles of different labels never overlap, so the greedy choice splits into one per label.
    """
    rows, columns = labels.shape
    free = np.empty((rows, columns), np.bool_)
    for r in range(rows):
        for c in range(columns):
            free[r, c] = labels[r, c] == label
    height = np.zeros(columns, np.int32)
    total = 0.0
    while True:
        best = 0
        bottom = right = top = left = 0
        for c in range(columns):
            height[c] = 0
        for r in range(rows):
            for c in range(columns):
                height[c] = height[c] + 1 if free[r, c] else 0
                # Widen to the left while the run lasts; the lowest column bounds the height.
                low = height[c]
                k = c
                while k >= 0 and height[k] > 0:
                    low = min(low, height[k])
                    size = low * (c - k + 1)
                    if size > best:
                        best, bottom, right, top, left = size, r, c, r - low + 1, k
                    k -= 1
        if best == 0:
            return total
        total += 1.0 / best
        for r in range(top, bottom + 1):
            for c in range(left, right + 1):
                free[r, c] = False


@njit(cache=True)
def _icm(previous: np.ndarray, cost: np.ndarray, alpha: float) -> tuple[np.ndarray, np.ndarray, int]:
    """Iterated conditional modes on Eq. 1: labels, the energy after each accepted move, and their number.

    Single cells move first; when none can, all cells of a type move at once to another one in use. Every accepted move
    lowers the energy, so both loops end.
    """
    rows, columns = previous.shape
    types = cost.shape[0]
    x = previous.copy()
    count = np.zeros(types, np.int64)
    rectangles = np.zeros(types)
    data = 0.0
    for r in range(rows):
        for c in range(columns):
            if x[r, c] >= 0:
                count[x[r, c]] += 1
    regular = 0.0
    for t in range(types):
        if count[t]:
            rectangles[t] = _rectangles(x, t)
            regular += 1 + 1 / count[t] + rectangles[t]
    energies = np.empty(64 + 16 * x.size)
    energies[0] = alpha * regular
    moves = 0
    moved = True
    while moved and moves < energies.size - x.size - types - 1:
        moved = False
        for r in range(rows):
            for c in range(columns):
                a = x[r, c]
                if a < 0:
                    continue
                p = previous[r, c]
                best, best_gain, best_a, best_b = a, -1e-9, 0.0, 0.0
                x[r, c] = -1
                without = _rectangles(x, a)
                loss_a = -1 - 1 / count[a] - rectangles[a]
                if count[a] > 1:
                    loss_a += 1 + 1 / (count[a] - 1) + without
                for b in range(types):
                    if b == a or count[b] == 0:
                        continue
                    x[r, c] = b
                    joined = _rectangles(x, b)
                    change = 1 / (count[b] + 1) - 1 / count[b] + joined - rectangles[b] + loss_a
                    gain = cost[p, b] - cost[p, a] + alpha * change
                    if gain < best_gain:
                        best, best_gain, best_a, best_b = b, gain, without, joined
                x[r, c] = best
                if best != a:
                    count[a] -= 1
                    count[best] += 1
                    rectangles[a], rectangles[best] = best_a, best_b
                    moves += 1
                    energies[moves] = energies[moves - 1] + best_gain
                    moved = True
        if moved:
            continue
        best_from, best_to, best_gain, best_sum = -1, -1, -1e-9, 0.0
        for a in range(types):
            for b in range(types):
                if a == b or count[a] == 0 or count[b] == 0:
                    continue
                data = 0.0
                trial = x.copy()
                for r in range(rows):
                    for c in range(columns):
                        if x[r, c] == a:
                            trial[r, c] = b
                            data += cost[previous[r, c], b] - cost[previous[r, c], a]
                joined = _rectangles(trial, b)
                change = 1 / (count[a] + count[b]) - 1 - 1 / count[a] - 1 / count[b]
                gain = data + alpha * (change + joined - rectangles[a] - rectangles[b])
                if gain < best_gain:
                    best_from, best_to, best_gain, best_sum = a, b, gain, joined
        if best_from >= 0:
            for r in range(rows):
                for c in range(columns):
                    if x[r, c] == best_from:
                        x[r, c] = best_to
            count[best_to] += count[best_from]
            count[best_from] = 0
            rectangles[best_to], rectangles[best_from] = best_sum, 0.0
            moves += 1
            energies[moves] = energies[moves - 1] + best_gain
            moved = True
    return x, energies, moves
