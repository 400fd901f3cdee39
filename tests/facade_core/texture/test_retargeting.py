from __future__ import annotations

import numpy as np
import pytest
from PIL import Image
from scipy import ndimage

from benchmarks.painter.facade import paint_facade as paint
from benchmarks.painter.styles import STYLES
from facade_core.core.errors import ImageError
from facade_core.core.labels import FacadeClass
from facade_core.facade.texture.retargeting import analyse_exemplar, initial_tiling, retarget
from facade_core.facade.texture.scale import exemplar_scale
from facade_core.facade.texture.shortest_walks import cheapest_walk, part_transition_costs
from facade_core.parsing.floor_structure import count_floors, find_floors_and_bays, floor_bay_lattice, window_row_spans

MPP = 0.08  # the drawn facade's 40 px floors are 3.2 m


def counts(labels: np.ndarray) -> tuple[int, int]:
    window = labels == FacadeClass.WINDOW
    return len(window_row_spans(window)), len(window_row_spans(window.T))


@pytest.mark.parametrize(("size", "floors"), [((14.0, 20.0), 3), ((30.0, 9.0), 7), ((10.0, 40.0), 2), ((20.0, 6.0), 5)])
def test_size_floors_doors_and_roof(facade, size, floors):
    (result,) = retarget(*facade, size, floors=floors, metres_per_pixel=MPP)
    assert result.image.shape == (round(size[0] / MPP), round(size[1] / MPP), 3)
    assert counts(result.labels)[0] == floors - 1, "the ground floor has a door and no windows"
    assert count_floors(result.labels) == floors
    street = np.isin(result.labels, (FacadeClass.DOOR, FacadeClass.SHOP)).any(1)
    assert street[-1]
    assert street.sum() < 0.5 * len(street)
    assert (result.labels == FacadeClass.DOOR)[-2].any()
    assert (result.labels[0] == FacadeClass.ROOF).mean() > 0.9
    assert not (result.labels == FacadeClass.SKY).any()


def test_windows_are_whole_and_of_the_exemplars_proportions(facade):
    (result,) = retarget(*facade, (20.0, 25.0), floors=5, metres_per_pixel=MPP)
    boxes = ndimage.find_objects(ndimage.label(result.labels == FacadeClass.WINDOW)[0])
    sides = np.array([[b.stop - b.start for b in box] for box in boxes])
    assert len(boxes) == 4 * counts(result.labels)[1]
    np.testing.assert_allclose(sides[:, 0] / sides[:, 1], 20 / 16, rtol=0.25)
    assert sides.std(0).max() < 1.5


def test_columns_are_obeyed(facade):
    for columns in (1, 3, 9):
        (result,) = retarget(*facade, (16.0, 18.0), floors=4, columns=columns, metres_per_pixel=MPP)
        assert counts(result.labels) == (3, columns)


def test_a_wall_narrower_than_half_a_bay_is_blank(facade):
    (result,) = retarget(*facade, (16.0, 1.0), floors=4, metres_per_pixel=MPP)
    assert not (result.labels == FacadeClass.WINDOW).any()


def test_results_differ_and_repeat_by_seed(facade):
    arguments = {"floors": 5, "metres_per_pixel": MPP, "n": 3}
    first = retarget(*facade, (20.0, 20.0), seed=4, **arguments)
    again = retarget(*facade, (20.0, 20.0), seed=4, **arguments)
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a.image, b.image)
    assert len({r.tiles.tobytes() for r in first}) == 3


def test_one_door_where_the_exemplar_has_one(facade):
    (result,) = retarget(*facade, (18.0, 14.0), floors=4, metres_per_pixel=MPP)
    assert ndimage.label((result.labels == FacadeClass.DOOR)[-2])[1] == 1


def test_bad_input_names_the_remedy(facade):
    with pytest.raises(ImageError, match="no windows"):
        retarget(facade.image, np.zeros_like(facade.labels), (10, 10), floors=2, metres_per_pixel=MPP)
    with pytest.raises(ImageError, match="at least 1"):
        retarget(*facade, (10, 10), floors=0, metres_per_pixel=MPP)
    with pytest.raises(ImageError, match="positive"):
        retarget(*facade, (10, -1), floors=1, metres_per_pixel=MPP)


def test_structure_of_the_drawn_facade(facade):
    found = find_floors_and_bays(facade.labels)
    assert found.kinds == ("middle",) * 4
    assert len(found.bays) == 4
    assert abs(found.ground_top - (facade.labels.shape[0] - 41)) < 12
    window = facade.labels == FacadeClass.WINDOW
    assert not any((window[c - 1] & window[c]).any() for c in found.floor_cuts[1:])
    assert not any((window[:, c - 1] & window[:, c]).any() for c in found.bay_cuts[1:-1])
    grid = floor_bay_lattice(found)
    assert (np.diff(grid.rows) > 0).all()
    assert (np.diff(grid.columns) > 0).all()


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize(("floors", "columns", "seed"), [(2, 6, 1), (4, 3, 2), (6, 5, 3)])
def test_storeys_are_those_that_were_painted(style, floors, columns, seed):
    size = (floors * 3.4 + 1.5, columns * 2.6)
    painted = paint(size, floors=floors, columns=columns, style=style, metres_per_pixel=0.05, seed=seed)
    in_the_roof = find_floors_and_bays(painted.labels).kinds.count("roof")
    assert count_floors(painted.labels) == floors + in_the_roof, "the ground floor counts, with windows or shops"


def test_a_low_base_is_no_storey_and_without_windows_nothing_tells(facade):
    low = facade.labels[:-30]
    assert not np.isin(low, (FacadeClass.DOOR, FacadeClass.SHOP))[:-12].any()
    assert count_floors(facade.labels) == 5
    assert (
        count_floors(
            np.where(np.isin(low, (FacadeClass.DOOR, FacadeClass.SHOP)), FacadeClass.WALL, low).astype(np.uint8)
        )
        == 4
    )
    assert count_floors(np.zeros_like(facade.labels)) == 0


@pytest.mark.parametrize("style", ["brick", "jugend", "neoclassical"])
def test_a_wall_of_one_storey_shows_windows_or_a_shop(style):
    painted = paint((14.0, 12.0), floors=4, columns=4, style=style, metres_per_pixel=0.06, seed=5)
    result = retarget(painted.image, painted.labels, (3.2, 9.0), floors=1, metres_per_pixel=0.06)[0]
    assert np.isin(result.labels, (FacadeClass.WINDOW, FacadeClass.SHOP)).any()


@pytest.mark.parametrize(
    ("height", "sill", "door"), [(3.0, 1.1, 2.1), (2.8, 1.0, 2.1), (3.2, 1.2, 2.2), (3.5, 1.0, 2.2)]
)
def test_a_cottage_has_one_storey_and_a_shop_under_windows_two(height, sill, door):
    labels = np.full((round(20 * height), 160), FacadeClass.WALL, np.uint8)
    for left in (20, 100):
        labels[-round(20 * (sill + 1.2)) : -round(20 * sill), left : left + 24] = FacadeClass.WINDOW
    assert count_floors(labels) == 1
    labels[-round(20 * door) :, 66:86] = FacadeClass.DOOR
    assert count_floors(labels) == 1
    above = np.full((round(20 * 3.0), 160), FacadeClass.WALL, np.uint8)
    above[20:46, 20:44] = above[20:46, 100:124] = FacadeClass.WINDOW
    shop = np.full((round(20 * 3.4), 160), FacadeClass.SHOP, np.uint8)
    assert count_floors(np.vstack([above, shop])) == 2


def test_walks_keep_neighbours_and_show_the_door_once():
    price = np.ones((4, 4))
    price[np.arange(3), np.arange(1, 4)] = 0.0
    ends = np.array([0.0, 9, 9, 9]), np.array([9.0, 9, 9, 0])
    np.testing.assert_array_equal(cheapest_walk(price, *ends, 4), [0, 1, 2, 3])
    door = np.array([False, True, False, False])
    walk = cheapest_walk(price, *ends, 9, marked=door, max_marked=1)
    assert (walk == 1).sum() == 1
    assert (walk[0], walk[-1]) == (0, 3)


def test_no_walk_cuts_a_door_or_half_a_balcony():
    labels = np.full((60, 160), FacadeClass.WALL, np.uint8)
    labels[20:, 70:90] = FacadeClass.DOOR  # across the middle cut
    labels[5:12, 10:70] = FacadeClass.BALCONY  # of the first two parts
    costs = part_transition_costs(np.zeros((60, 160, 3), np.uint8), labels, np.arange(0, 161, 40), [0, 60])
    for length in (1, 2, 3, 4, 6):
        walk = cheapest_walk(*costs, length)
        assert not costs.cuts_elements(walk)
    for walk in ([1], [0, 1], [2, 3], [0, 2, 3], [0, 1, 2, 2, 3], [1, 2, 3]):
        assert costs.cuts_elements(np.array(walk))


def test_scale_from_floors_a_door_or_one_row(facade):
    assert exemplar_scale(*facade) == pytest.approx(3.2 / 40, rel=0.02)
    assert exemplar_scale(*facade, storey=4.0) == pytest.approx(0.1, rel=0.02)
    door = np.zeros_like(facade.labels)
    door[-30:, 5:20] = FacadeClass.DOOR
    assert exemplar_scale(facade.image, door) == pytest.approx(2.4 / 30)
    row = np.zeros_like(facade.labels)
    row[50:72, 5:20] = FacadeClass.WINDOW
    assert exemplar_scale(facade.image, row) == pytest.approx(0.55 * 3.2 / 22, rel=0.1)
    with pytest.raises(ImageError, match="label the exemplar"):
        exemplar_scale(facade.image, np.zeros_like(facade.labels))


def test_haussmann_facades_keep_their_floors(data):
    folder = data / "facades" / "ecp"
    for name in ("monge_10", "monge_55", "monge_74"):
        image = np.array(Image.open(folder / "images" / f"{name}.jpg").convert("RGB"))
        labels = np.array(Image.open(folder / "labels" / f"{name}.png"))
        labels = np.where(labels == 7, FacadeClass.ROOF, labels).astype(np.uint8)
        scale = exemplar_scale(image, labels)
        assert 0.02 < scale < 0.06
        for size, floors in (((19.0, 24.0), 6), ((16.0, 8.0), 4), ((25.0, 14.0), 8)):
            (result,) = retarget(image, labels, size, floors=floors, metres_per_pixel=scale)
            rows = window_row_spans(result.labels == FacadeClass.WINDOW)
            street = [np.isin(result.labels[a:b], (FacadeClass.DOOR, FacadeClass.SHOP)).mean() > 0.1 for a, b in rows]
            assert len(rows) - sum(street) == floors - 1
            assert count_floors(result.labels) == floors
            assert result.image.shape[:2] == (round(size[0] / scale), round(size[1] / scale))


def test_no_door_and_no_shop_is_above_the_ground(facade):
    labels = facade.labels.copy()
    labels[40:60, 20:30], labels[40:60, 50:60] = FacadeClass.DOOR, FacadeClass.SHOP
    style = analyse_exemplar(facade.image, labels)
    entrances = np.isin(style.labels, (FacadeClass.DOOR, FacadeClass.SHOP))
    assert entrances[style.structure.ground_top :].any()
    assert not entrances[: style.structure.ground_top].any()
    assert (style.labels[40:60, 20:30] == FacadeClass.WINDOW).all(), "a door of a balcony"


def test_a_wide_wall_has_a_door_for_each_house_of_the_exemplars_width(facade):
    style = analyse_exemplar(facade.image, facade.labels)
    bays = len(style.structure.bays)
    lowest = len(style.structure.kinds) - 1 if style.structure.kinds[-1] == "ground" else -1
    for houses in (1, 2, 3):
        rng = np.random.default_rng(0)
        ground = initial_tiling(style, [0, lowest], houses * bays, False, rng, 0.0)[-1]
        shown = (ground % (len(style.grid.columns) - 1))[::3] // 3
        assert 1 <= style.doors[shown].sum() <= houses
        assert not (style.doors[shown][1:] & style.doors[shown][:-1]).any()
