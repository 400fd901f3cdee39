import numpy as np
import pytest

from facade_core.core.errors import LayoutError
from facade_core.core.types import Element
from facade_core.facade.layout.grids import fit_grids


def window(cx, cy, w=10.0, h=16.0, label="window"):
    return Element(label, cx - w / 2, cy - h / 2, cx + w / 2, cy + h / 2)


def block(columns, rows, **size):
    return [window(x, y, **size) for y in rows for x in columns]


def test_one_full_grid_with_jitter():
    rng = np.random.default_rng(1)
    elements = [window(x + rng.uniform(-1, 1), y + rng.uniform(-1, 1)) for y in (20, 60, 100) for x in (15, 40, 65, 90)]
    (grid,) = fit_grids(elements)
    assert grid.cells.shape == (3, 4)
    assert grid.completeness == 1
    assert np.allclose(grid.columns, (15, 40, 65, 90), atol=1)
    assert np.allclose(np.diff(grid.rows), 40, atol=2)
    assert (grid.width, grid.height) == (10, 16)


def test_missing_cells_are_minus_one_and_every_element_has_one_cell():
    elements = block((15, 40, 65), (20, 60))
    del elements[4]
    (grid,) = fit_grids(elements)
    assert grid.cells.tolist() == [[0, 1, 2], [3, -1, 4]]


def test_labels_and_sizes_make_their_own_grids():
    elements = block((15, 40, 65), (20, 60)) + block((15, 40, 65), (30, 70), h=4.0, label="balcony")
    elements += block((15, 55), (120,), w=30.0, h=30.0)
    found = fit_grids(elements)
    assert [(g.label, g.cells.shape) for g in found] == [("window", (2, 3)), ("window", (1, 2)), ("balcony", (2, 3))]
    assert sorted(np.concatenate([g.cells.ravel() for g in found]).tolist()) == list(range(len(elements)))


def test_interleaved_rows_are_two_grids():
    elements = block((15, 45, 75), (20, 60, 100)) + block((30, 60), (40, 80))
    assert [g.cells.shape for g in fit_grids(elements)] == [(3, 3), (2, 2)]


def test_order_does_not_matter():
    elements = block((15, 40, 65), (20, 60))
    a, b = fit_grids(elements), fit_grids(elements[::-1])
    assert (a[0].rows, a[0].columns) == (b[0].rows, b[0].columns)


def test_duplicate_goes_to_a_grid_of_its_own():
    elements = [*block((15, 40), (20,)), window(15, 20)]
    assert sorted((g.cells >= 0).sum() for g in fit_grids(elements)) == [1, 2]


def test_nothing_gives_no_grid():
    assert fit_grids([]) == []


@pytest.mark.parametrize(
    ("element", "message"),
    [
        (Element("gargoyle", 0, 0, 1, 1), "unknown label"),
        (Element("window", 3, 0, 3, 1), "no area"),
        (Element("window", 0, float("nan"), 3, 1), "finite"),
    ],
)
def test_bad_elements(element, message):
    with pytest.raises(LayoutError, match=message):
        fit_grids([window(10, 10), element])
