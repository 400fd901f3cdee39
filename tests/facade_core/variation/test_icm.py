"""Incremental ICM gives the results of ICM that recomputes everything."""

from __future__ import annotations

import numpy as np
import pytest

from facade_core.facade.variation.icm import FIXED_POINT_ONE, initial_icm_state, run_icm, sum_reciprocal_rectangle_sizes


def plain_icm(previous: np.ndarray, cost: np.ndarray, alpha: float) -> tuple[np.ndarray, list[float]]:
    """The reference: every sum of every trial from all cells."""
    x, types = previous.copy(), len(cost)

    def total(label: int) -> float:
        return sum_reciprocal_rectangle_sizes(x == label)

    def regular(label: int) -> float:
        count = (x == label).sum()
        return 1 + 1 / count + total(label) / FIXED_POINT_ONE if count else 0.0

    energies = [alpha * sum(regular(t) for t in range(types))]
    moved = True
    while moved:
        moved = False
        for at in zip(*np.nonzero(x >= 0), strict=True):
            a, p = x[at], previous[at]
            count = np.bincount(x[x >= 0], minlength=types)
            whole = [total(t) for t in range(types)]
            x[at] = -1
            loss = (total(a) - whole[a]) / FIXED_POINT_ONE - 1 - 1 / count[a]
            if count[a] > 1:
                loss += 1 + 1 / (count[a] - 1)
            best, gain = a, -1e-9
            for b in range(types):
                if b == a or count[b] == 0:
                    continue
                x[at] = b
                change = 1 / (count[b] + 1) - 1 / count[b] + (total(b) - whole[b]) / FIXED_POINT_ONE + loss
                here = cost[p, b] - cost[p, a] + alpha * change
                if here < gain:
                    best, gain = b, here
            x[at] = best
            if best != a:
                energies.append(energies[-1] + gain)
                moved = True
        if moved:
            continue
        count = np.bincount(x[x >= 0], minlength=types)
        best_pair, gain = None, -1e-9
        for a in range(types):
            for b in range(types):
                if a == b or count[a] == 0 or count[b] == 0:
                    continue
                data = 0.0
                for at in zip(*np.nonzero(x == a), strict=True):
                    data += cost[previous[at], b] - cost[previous[at], a]
                merged = sum_reciprocal_rectangle_sizes((x == a) | (x == b)) - total(a) - total(b)
                change = 1 / (count[a] + count[b]) - 1 - 1 / count[a] - 1 / count[b] + merged / FIXED_POINT_ONE
                if data + alpha * change < gain:
                    best_pair, gain = (a, b), data + alpha * change
        if best_pair:
            x[x == best_pair[0]] = best_pair[1]
            energies.append(energies[-1] + gain)
            moved = True
    return x, energies


@pytest.mark.parametrize("seed", range(12))
def test_the_same_moves_as_computing_everything_again(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows, columns, types = int(rng.integers(1, 7)), int(rng.integers(2, 9)), int(rng.integers(2, 8))
    labels = rng.integers(types, size=(rows, columns)).astype(np.int32)
    labels[rng.random(labels.shape) < 0.1 * (seed % 3)] = -1
    labels[0, 0] = 0
    # Few distinct costs: ties must fall alike too.
    cost = rng.choice([0.1, 0.4, 1.0], size=(types, types))
    cost = np.maximum(cost, cost.T) * (1 - np.eye(types))
    moves = initial_icm_state(labels, types)
    for alpha in np.geomspace(1e-3, 1e3, 12):
        expected, energies = plain_icm(labels, cost, alpha)
        found = run_icm(moves, cost, alpha)
        np.testing.assert_array_equal(moves.labels, expected)
        np.testing.assert_array_equal(found, energies)
        assert [sum_reciprocal_rectangle_sizes(expected == t) for t in range(types)] == moves.reciprocal_sums.tolist()
        labels = expected
