import numpy as np
import pytest

from facade_core.facade.variation.icm import FIXED_POINT_ONE, sum_reciprocal_rectangle_sizes
from facade_core.facade.variation.structure import regularise_structure_matrix


def regularity_terms(structure):
    """Number of types, sum of reciprocal counts, sum of reciprocal sizes of rectangles: the terms of E_reg."""
    labels = np.ascontiguousarray(structure, np.int32)
    types, counts = np.unique(labels[labels >= 0], return_counts=True)
    sizes = sum(sum_reciprocal_rectangle_sizes(labels == label) for label in types)
    return len(types), (1 / counts).sum(), sizes / FIXED_POINT_ONE


def rectangles_by_search(structure):
    """Plain reference: biggest uniform rectangle first, none overlapping, sum of 1/size."""
    free = structure >= 0
    rows, columns = structure.shape
    total = 0.0
    while free.any():
        best = (0, None)
        for r0 in range(rows):
            for r1 in range(r0 + 1, rows + 1):
                for c0 in range(columns):
                    for c1 in range(c0 + 1, columns + 1):
                        part = structure[r0:r1, c0:c1]
                        if free[r0:r1, c0:c1].all() and (part == part[0, 0]).all() and part.size > best[0]:
                            best = (part.size, np.s_[r0:r1, c0:c1])
        total += 1 / best[0]
        free[best[1]] = False
    return total


def energy(previous, labels, cost, alpha):
    used = labels >= 0
    return cost[previous[used], labels[used]].sum() + alpha * sum(regularity_terms(labels))


def random_case(seed, types=4, rows=3, columns=5, holes=2):
    rng = np.random.default_rng(seed)
    structure = rng.integers(types, size=(rows, columns)).astype(np.int32)
    structure.ravel()[rng.permutation(structure.size)[:holes]] = -1
    points = rng.random((types, 2))
    cost = ((points[:, None] - points) ** 2).sum(axis=2) ** 3
    return structure, cost / cost.max()


def test_unique_and_repeat_of_the_papers_third_figure():
    structure = np.repeat(np.arange(5), (6, 5, 1, 3, 3)).reshape(9, 2)
    unique, repeat, _ = regularity_terms(structure)
    assert unique == 5
    assert repeat == pytest.approx(1 / 6 + 1 / 5 + 1 + 1 / 3 + 1 / 3)


@pytest.mark.parametrize(
    ("structure", "expected"),
    [
        ([[0, 0], [0, 0]], 1 / 4),
        ([[0, 1], [1, 0]], 4),
        ([[0, 0, 1], [0, 0, 1], [1, 1, 1]], 1 / 4 + 1 / 3 + 1 / 2),
        ([[0, 0, 0], [0, -1, 0], [0, 0, 0]], 1 / 3 + 1 / 3 + 1 + 1),
        ([[-1, -1]], 0),
    ],
)
def test_sub_rectangles_by_hand(structure, expected):
    assert regularity_terms(np.array(structure))[2] == pytest.approx(expected)


@pytest.mark.parametrize("seed", range(8))
def test_sub_rectangles_match_a_search(seed):
    structure, _ = random_case(seed, types=2, rows=4, columns=4)
    # Both take the biggest first; among equals they may choose differently, which small matrices bound.
    assert regularity_terms(structure)[2] == pytest.approx(rectangles_by_search(structure), rel=0.35)
    rows = np.repeat(structure[:, :1], 4, axis=1)
    assert regularity_terms(rows)[2] == pytest.approx(rectangles_by_search(rows))


@pytest.mark.parametrize("seed", range(6))
def test_energy_falls_and_matches_its_definition(seed):
    previous, cost = random_case(seed)
    found = regularise_structure_matrix(previous, cost)
    for step in found:
        if np.isfinite(step.alpha):
            assert (np.diff(step.energies) < 0).all()
            assert step.energies[0] == pytest.approx(energy(previous, previous, cost, step.alpha))
            assert step.energies[-1] == pytest.approx(energy(previous, step.labels, cost, step.alpha))
        assert ((step.labels < 0) == (previous < 0)).all()
        previous = step.labels
    assert len(np.unique(previous[previous >= 0])) == 1


@pytest.mark.parametrize("seed", range(6))
def test_no_single_change_improves_a_solution(seed):
    previous, cost = random_case(seed)
    for step in regularise_structure_matrix(previous, cost):
        if not np.isfinite(step.alpha):
            continue
        lowest = energy(previous, step.labels, cost, step.alpha)
        for at in np.argwhere(step.labels >= 0):
            for label in np.unique(step.labels[step.labels >= 0]):
                other = step.labels.copy()
                other[tuple(at)] = label
                assert energy(previous, other, cost, step.alpha) >= lowest - 1e-8
        previous = step.labels


def test_cheap_relabelling_comes_first():
    structure = np.array([[0, 0, 1], [0, 0, 2], [0, 0, 0]], np.int32)
    cost = np.array([[0, 0.01, 1], [0.01, 0, 1], [1, 1, 0]])
    states = [r.labels for r in regularise_structure_matrix(structure, cost)]
    assert any((s[0, 2], s[1, 2]) == (0, 2) for s in states)
    assert not any((s[0, 2], s[1, 2]) == (1, 0) for s in states)


def test_uniform_matrix_has_nothing_to_relax():
    assert regularise_structure_matrix(np.zeros((2, 3), np.int32), np.zeros((1, 1))) == []
