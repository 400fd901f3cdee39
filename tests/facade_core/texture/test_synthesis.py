from __future__ import annotations

import numpy as np
import pytest

from facade_core.errors import ImageError
from facade_core.parse import lattice
from facade_core.texture import synthesize
from facade_core.texture.consistency import ORDER, energy, tables
from facade_core.texture.tiles import cells, synthesize_on


def reference(tab, tiles: np.ndarray) -> float:
    """Eq. 4 written out with numpy."""
    out = tab.photo_right[tiles[:, :-1], tiles[:, 1:]].sum(dtype=float)
    out += tab.photo_below[tiles[:-1], tiles[1:]].sum(dtype=float)
    kinds = tab.kind[tiles]
    for grid, templates, scale in (
        (kinds, tab.templates_right, tab.scale_right),
        (kinds.T, tab.templates_below, tab.scale_below),
    ):
        runs = np.lib.stride_tricks.sliding_window_view(grid, templates.shape[1], axis=1)
        squared = tab.kind_distance[runs[:, :, None], templates[None, None]].sum(-1, dtype=float)
        out += squared.min(-1).sum() * scale
    return float(out)


def test_energy_equals_the_reference(facade):
    tab = tables(*facade, lattice(facade.labels))
    rng = np.random.default_rng(1)
    for shape in ((5, 6), (9, 4), (ORDER, ORDER)):
        tiles = rng.integers(0, len(tab.kind), shape).astype(np.int32)
        assert energy(tab, tiles) == pytest.approx(reference(tab, tiles), rel=1e-5)


def test_the_exemplar_itself_costs_nothing(facade):
    grid = lattice(facade.labels)
    tab = tables(*facade, grid)
    own = np.arange(len(tab.kind), dtype=np.int32).reshape(len(grid.rows) - 1, -1)
    assert energy(tab, own) == 0.0
    assert energy(tab, own[:, ::-1].copy()) > 1.0


def test_incremental_energy_is_the_energy_of_the_result(facade):
    grid = lattice(facade.labels)
    result = synthesize_on(*facade, grid, (220, 300), generations=300)
    assert result.energy == energy(tables(*facade, grid), result.tiles)


def test_more_generations_give_less_energy(facade):
    grid = lattice(facade.labels)
    few, many = (synthesize_on(*facade, grid, (280, 300), generations=n).energy for n in (10, 1500))
    assert many < 0.7 * few


def test_size_borders_and_determinism(facade):
    first, again = (synthesize(*facade, (200, 260), seed=3) for _ in range(2))
    assert first.image.shape == (200, 260, 3)
    assert first.labels.shape == (200, 260)
    across = len(lattice(facade.labels).columns) - 1
    rows = len(lattice(facade.labels).rows) - 1
    assert (first.tiles[0] // across == 0).all()
    assert (first.tiles[-1] // across == rows - 1).all()
    np.testing.assert_array_equal(first.image, again.image)
    assert set(np.unique(first.labels)) <= set(np.unique(facade.labels))


def test_cells_fill_the_size():
    borders = cells(np.array([3.0, 1.0, 2.5]), 40)
    assert borders[0] == 0
    assert borders[-1] == 40
    assert (np.diff(borders) > 0).all()


def test_bad_input_names_the_remedy(facade):
    with pytest.raises(ImageError, match="pass uint8 RGB"):
        synthesize(facade.image.astype(float), facade.labels, (100, 100))
    with pytest.raises(ImageError, match="pass uint8 class ids"):
        synthesize(facade.image, facade.labels[1:], (100, 100))
    with pytest.raises(ImageError, match="too small"):
        synthesize(*facade, (3, 100))
