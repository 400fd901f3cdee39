from __future__ import annotations

import cv2
import numpy as np
import pytest

from benchmarks.papers.tile_search import plain_energy, search_plainly
from facade_core.core.errors import ImageError
from facade_core.core.labels import FacadeClass
from facade_core.core.types import Lattice
from facade_core.facade.texture.synthesis import cell_borders, evolve_random_tilings, synthesize, synthesize_on_lattice
from facade_core.facade.texture.tile_composition import compose_tiles
from facade_core.facade.texture.tiling_energy import (
    TEMPLATE_ORDER,
    EnergyTables,
    sum_costs,
    tabulate_energy,
    update_costs,
)
from facade_core.parsing.lattice import lattice


def tiling_energy(tables: EnergyTables, tiles: np.ndarray) -> float:
    """Eq. 4 of a tiling: minus the log of the product of all constraint terms."""
    cost = np.zeros((4, *tiles.shape))
    update_costs(tables, cost, tiles, 0, tiles.shape[0], 0, tiles.shape[1])
    return float(sum_costs(cost))


def test_energy_equals_the_reference(facade):
    tab = tabulate_energy(*facade, lattice(facade.labels))
    rng = np.random.default_rng(1)
    for shape in ((5, 6), (9, 4), (TEMPLATE_ORDER, TEMPLATE_ORDER)):
        tiles = rng.integers(0, len(tab.kind), shape).astype(np.int32)
        assert tiling_energy(tab, tiles) == pytest.approx(plain_energy(tab, tiles), rel=1e-5)


def test_the_exemplar_itself_costs_nothing(facade):
    grid = lattice(facade.labels)
    tab = tabulate_energy(*facade, grid)
    own = np.arange(len(tab.kind), dtype=np.int32).reshape(len(grid.rows) - 1, -1)
    assert tiling_energy(tab, own) == 0.0
    assert tiling_energy(tab, own[:, ::-1].copy()) > 1.0


def test_incremental_energy_is_the_energy_of_the_result(facade):
    grid = lattice(facade.labels)
    result = synthesize_on_lattice(*facade, grid, (220, 300), generations=300)
    assert result.energy == tiling_energy(tabulate_energy(*facade, grid), result.tiles)


def test_more_generations_give_less_energy(facade):
    grid = lattice(facade.labels)
    few, many = (synthesize_on_lattice(*facade, grid, (280, 300), generations=n).energy for n in (10, 1500))
    assert many < 0.7 * few


def test_generations_reach_what_the_plain_algorithm_reaches(facade):
    grid = lattice(facade.labels, max_lines=12)
    tab, shape = tabulate_energy(*facade, grid), (5, 6)
    runs = [evolve_random_tilings(tab, grid, shape, np.random.default_rng(s), 200)[1] for s in range(8)]
    assert all((np.diff(run) <= 0).all() for run in runs)
    plain = np.mean([search_plainly(tab, shape, grid, 200, s) for s in range(8)])
    assert np.mean([run[-1] for run in runs]) < 1.2 * plain


@pytest.mark.long
def test_tiles_in_their_own_order_show_the_exemplar():
    image = np.full((40, 60, 3), 100, np.uint8)
    image[:, 30:] = 200
    image[:, 27:33] = 150
    grid = Lattice((0, 40), (0, 30, 60))
    own, _ = compose_tiles(
        image, np.zeros((40, 60), np.uint8), grid, np.array([[0, 1]]), np.array([0, 40]), np.array([0, 30, 60])
    )
    np.testing.assert_allclose(own.astype(int), image, atol=1)


def test_the_colour_of_walls_fades_over_a_border_and_no_window_shines_through():
    image = np.full((40, 120, 3), 100, np.uint8)
    image[:, 60:] = 140
    labels = np.full((40, 120), FacadeClass.WALL, np.uint8)
    image[10:30, 100:116], labels[10:30, 100:116] = 20, FacadeClass.WINDOW
    shown, carried = compose_tiles(
        image, labels, Lattice((0, 40), (0, 60, 120)), np.array([[1, 0]]), np.array([0, 40]), np.array([0, 60, 120])
    )
    window = carried == FacadeClass.WINDOW
    assert window.sum() == 20 * 16
    assert abs(shown[window].astype(int) - 20).max() <= 20, "it changes with the light of its wall alone"
    assert 98 <= shown[~window].min() <= shown[~window].max() <= 142
    assert np.abs(np.diff(shown[0, :, 0].astype(int))).max() < 10, "no edge"


def test_cells_without_width_do_not_smear_the_others():
    """Piers of a pixel vanish beside a shop that fills the ground floor."""
    image = np.random.default_rng(0).integers(0, 256, (40, 60, 3), dtype=np.uint8)
    image = cv2.GaussianBlur(image, (0, 0), 2)
    whole, _ = compose_tiles(
        image,
        np.zeros((40, 60), np.uint8),
        Lattice((0, 40), (0, 1, 59, 60)),
        np.array([[0, 1, 2]]),
        np.array([0, 40]),
        np.array([0, 0, 58, 58]),
    )
    np.testing.assert_allclose(whole[:, 5:-5].astype(int), image[:, 6:-6], atol=1)


def test_a_narrow_tile_is_repeated_instead_of_smeared():
    """Bare wall of a pier fills the place of a bay with its own grain."""
    image = np.random.default_rng(0).integers(0, 256, (40, 60, 3), dtype=np.uint8)
    image = cv2.GaussianBlur(image, (0, 0), 1)
    cells = np.array([0, 40]), np.array([0, 30, 90])
    labels = np.zeros((40, 60), np.uint8)
    wide, _ = compose_tiles(image, labels, Lattice((0, 40), (0, 30, 42, 60)), np.array([[0, 1]]), *cells)
    np.testing.assert_allclose(wide[:, 54:66].astype(int), image[:, 30:42], atol=2)
    np.testing.assert_allclose(wide[:, 66:78].astype(int), image[:, 41:29:-1], atol=2)


def test_a_seam_adds_no_sliver_of_a_window_and_cuts_none():
    """The second floor is left out; windows end at its foot, so that a seam that moves up would show them."""
    image = np.random.default_rng(0).integers(0, 256, (60, 40, 3), dtype=np.uint8)
    labels = np.zeros((60, 40), np.uint8)
    labels[30:40, 10:20] = FacadeClass.WINDOW
    labels[42:50, 25:35] = FacadeClass.WINDOW
    rows, columns = np.array([0, 20, 40]), np.array([0, 40])
    _, shown = compose_tiles(image, labels, Lattice((0, 20, 40, 60), (0, 40)), np.array([[0], [2]]), rows, columns)
    np.testing.assert_array_equal(shown, np.concatenate([labels[:20], labels[40:]]))


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
    borders = cell_borders(np.array([3.0, 1.0, 2.5]), 40)
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
