"""Neighbours in a picture of painted houses: cut off by their colours, their rows, and what the parser finds between them."""

from __future__ import annotations

import numpy as np

from benchmarks.painter.facade import PaintedFacade, paint_facade
from facade_core.core.labels import FacadeClass
from facade_core.facade.exemplar_trimming import find_whole_columns
from facade_core.facade.neighbour_removal import find_clean_columns, find_own_columns
from facade_core.parsing.floor_structure import find_floors_and_bays


def paint_house(width: float, columns: int, floors: int = 4) -> PaintedFacade:
    return paint_facade((14.0, width), floors=floors, columns=columns, style="plaster", metres_per_pixel=0.03, seed=2)


def find_columns(image: np.ndarray, labels: np.ndarray, outside: np.ndarray | None = None) -> tuple[int, int]:
    nothing = np.zeros(labels.shape, bool)
    return find_own_columns(image, labels, nothing, nothing if outside is None else outside)


def test_one_house_stays_whole() -> None:
    house = paint_house(13.0, 5)
    assert find_columns(house.image, house.labels) == (0, house.labels.shape[1])


def test_a_neighbour_of_another_colour_and_other_rows_is_cut_off() -> None:
    house, neighbour = paint_house(13.0, 5), paint_house(8.0, 3, floors=5)
    tinted = np.clip(neighbour.image * [0.6, 0.9, 0.6], 0, 255).astype(np.uint8)
    both = np.concatenate([house.image, tinted], axis=1), np.concatenate([house.labels, neighbour.labels], axis=1)
    left, right = find_columns(*both)
    assert left == 0
    assert abs(right - house.labels.shape[1]) < 0.05 * both[1].shape[1]


def test_columns_outside_part_two_houses() -> None:
    house = paint_house(13.0, 5)
    width = house.labels.shape[1]
    outside = np.zeros(house.labels.shape, bool)
    outside[:, width // 5 : width // 5 + 4] = True
    assert find_columns(house.image, house.labels, outside) == (width // 5 + 4, width)


def test_the_picture_stays_whole_where_too_few_bays_would_remain() -> None:
    house = paint_house(6.0, 2)
    width = house.labels.shape[1]
    outside = np.zeros(house.labels.shape, bool)
    outside[:, width // 2 : width // 2 + 4] = True
    assert find_columns(house.image, house.labels, outside) == (0, width)


def test_a_narrow_strip_of_another_colour_is_cut_off() -> None:
    house = paint_house(13.0, 5)
    width = house.labels.shape[1]
    image = house.image.copy()
    image[:, : width // 30] = (120, 150, 90)
    left, right = find_columns(image, house.labels)
    assert abs(left - width // 30) <= 0.02 * width
    assert right == width


def test_a_lamp_beside_the_outer_window_is_cut_off_up_to_clean_wall() -> None:
    house = paint_house(13.0, 4)
    width, found = house.labels.shape[1], find_floors_and_bays(house.labels)
    assert found is not None
    assert find_clean_columns(house.image, house.labels) == (0, width)
    image = house.image.copy()
    image[150:200, :9] = (10, 12, 14)
    assert find_clean_columns(image, house.labels) == (9, width)
    assert find_clean_columns(image[:, ::-1], house.labels[:, ::-1]) == (0, width - 9)
    image[150:200, : found.bays[0][0]] = (10, 12, 14)
    assert find_clean_columns(image, house.labels) == (0, width), "no clean wall is left beside the window"
    image = house.image.copy()
    for left, right in found.bays:
        image[:, max(0, left - 8) : left] = image[:, right : right + 8] = (10, 70, 30)
    image[:, : found.bays[0][0] - 8] = image[:, found.bays[1][0] - 20 : found.bays[1][0] - 19]
    assert find_clean_columns(image, house.labels) == (0, width), "shutters belong to the facade"


def test_what_is_on_both_sides_is_built() -> None:
    house = paint_house(13.0, 4)
    width, image = house.labels.shape[1], house.image.copy()
    for top in range(0, 300, 40):
        image[top : top + 20, :9] = image[top : top + 20, -9:] = (150, 60, 40)
    assert find_clean_columns(image, house.labels) == (0, width)
    image[:, -9:] = house.image[:, -9:]
    assert find_clean_columns(image, house.labels) == (9, width)


def test_a_window_or_door_of_any_floor_that_a_side_cuts_is_cut_off() -> None:
    house = paint_house(13.0, 4)
    labels, width = house.labels, house.labels.shape[1]
    found = find_floors_and_bays(labels)
    assert found is not None
    assert find_whole_columns(labels, found) == (0, width)
    beside = found.bays[0][0]
    door = labels.copy()
    door[-60:, : beside // 3] = FacadeClass.DOOR
    left, right = find_whole_columns(door, found)
    assert beside // 3 < left < beside
    assert right == width
    cut = labels[:, (found.bays[0][0] + found.bays[0][1]) // 2 :]
    whole = find_floors_and_bays(cut)
    assert whole is not None
    left, right = find_whole_columns(cut, whole)
    assert whole.bays[0][1] < left < whole.bays[1][0]
