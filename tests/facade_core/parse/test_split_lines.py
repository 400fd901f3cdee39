import numpy as np
import pytest

from facade_core.core.errors import ImageError, LayoutError
from facade_core.core.labels import UNKNOWN, FacadeClass
from facade_core.parsing.lattice import lattice


def plain_lattice(labels, max_lines, eta):
    """Algo. 1 word by word: every score from its definition, with exact fractions."""
    from fractions import Fraction

    height, width = labels.shape
    lines = {"row": [0, height], "column": [0, width]}

    def score(axis, at):
        if axis == "row":
            edge = Fraction(sum(int(labels[at - 1, w] != labels[at, w]) for w in range(width)), width)
        else:
            edge = Fraction(sum(int(labels[h, at - 1] != labels[h, at]) for h in range(height)), height)
        return edge * min(abs(at - line) for line in lines[axis])

    first = None
    while len(lines["row"]) + len(lines["column"]) < max_lines:
        candidates = [("row", at) for at in range(1, height)] + [("column", at) for at in range(1, width)]
        if not candidates:
            break
        best = max(candidates, key=lambda candidate: score(*candidate))  # max keeps the first of equals
        value = score(*best)
        first = value if first is None else first
        if value <= Fraction(eta) * first:
            break
        lines[best[0]].append(best[1])
    return tuple(sorted(lines["row"])), tuple(sorted(lines["column"]))


@pytest.mark.parametrize("seed", range(12))
def test_agrees_with_the_plain_form_on_random_maps(seed):
    rng = np.random.default_rng(seed)
    height, width = rng.integers(1, 22, 2)
    labels = rng.integers(0, 3, (height, width)).astype(np.uint8)
    if seed % 2:
        labels = np.repeat(np.repeat(labels[::4, ::3], 4, 0), 3, 1)
    max_lines = int(rng.integers(4, 30))
    eta = float(rng.choice([0.0, 0.02, 0.3]))
    found = lattice(labels, max_lines=max_lines, eta=eta)
    assert (found.rows, found.columns) == plain_lattice(labels, max_lines, eta)


def test_lines_lie_on_the_borders_of_windows():
    labels = np.full((60, 80), FacadeClass.WALL, np.uint8)
    labels[:10] = FacadeClass.ROOF
    for y in (16, 40):
        for x in (8, 32, 56):
            labels[y : y + 12, x : x + 14] = FacadeClass.WINDOW
    found = lattice(labels, eta=0.0)
    assert found.rows == (0, 10, 16, 28, 40, 52, 60)
    assert found.columns == (0, 8, 22, 32, 46, 56, 70, 80)


def test_first_line_and_stop_by_eta():
    labels = np.full((10, 10), FacadeClass.WALL, np.uint8)
    labels[5:] = FacadeClass.ROOF  # Eq. 1 = 1, distance 5: score 5
    labels[0, 9] = FacadeClass.DOOR  # column 9: score 1/10 * 1, row 1: score 1/10 * 1
    assert lattice(labels, eta=0.02 + 1e-9).rows == (0, 5, 10)
    assert lattice(labels, eta=0.02 + 1e-9).columns == (0, 10)
    found = lattice(labels, eta=0.02 - 1e-9)
    assert (found.rows, found.columns) == ((0, 1, 5, 10), (0, 9, 10))


def test_ties_go_to_rows_then_to_the_smaller_position():
    labels = np.zeros((9, 9), np.uint8)
    labels[3:6] = 1  # row edges at 3 and 6, both 3 from a border
    labels = np.maximum(labels, labels.T)
    first = lattice(labels, max_lines=5)
    assert (first.rows, first.columns) == ((0, 3, 9), (0, 9))


def test_max_lines_counts_the_borders():
    labels = np.indices((30, 30)).sum(0).astype(np.uint8) % 2
    for most in (4, 5, 11, 40):
        found = lattice(labels, max_lines=most, eta=0.0)
        assert len(found.rows) + len(found.columns) == most


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (7, 1), (20, 30)])
def test_a_uniform_map_has_its_borders_only(shape):
    found = lattice(np.full(shape, FacadeClass.WINDOW, np.uint8))
    assert (found.rows, found.columns) == ((0, shape[0]), (0, shape[1]))


def test_unknown_is_a_label_of_its_own():
    labels = np.full((8, 8), FacadeClass.WALL, np.uint8)
    labels[4:] = UNKNOWN
    assert lattice(labels).rows == (0, 4, 8)


@pytest.mark.parametrize(
    "labels",
    [np.zeros((0, 4), np.uint8), np.zeros((4, 4, 1), np.uint8), np.zeros((4, 4)), np.full((4, 4), 7, np.uint8), [[1]]],
)
def test_refuses_what_is_no_label_map(labels):
    with pytest.raises(ImageError, match="labels"):
        lattice(labels)


@pytest.mark.parametrize("options", [{"max_lines": 3}, {"eta": -0.1}, {"eta": float("nan")}, {"eta": 1.5}])
def test_refuses_impossible_options(options):
    with pytest.raises(LayoutError):
        lattice(np.zeros((4, 4), np.uint8), **options)
