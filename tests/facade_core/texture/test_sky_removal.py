"""Sky above the eaves that the labels take for wall: found by its colour and evenness, without the wall and its windows."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.painter.facade import PaintedFacade, paint_facade
from facade_core.core.labels import FacadeClass
from facade_core.facade.sky_removal import count_sky_rows, find_even_sky
from facade_core.parsing.floor_structure import find_floors_and_bays

ROWS = 40


def count_rows(image: np.ndarray, labels: np.ndarray) -> int:
    """Count the rows of sky by colour alone."""
    nothing = np.zeros(labels.shape, bool)
    return count_sky_rows(image, labels, nothing, nothing)


def paint_house(style: str = "brick") -> PaintedFacade:
    return paint_facade((18.0, 14.0), floors=5, columns=5, style=style, metres_per_pixel=0.0625, seed=2)


def put_over(facade: PaintedFacade, colour: tuple[int, int, int], share: float) -> tuple[np.ndarray, np.ndarray]:
    """Put rows over a facade that show a colour in a share of their width, beside a gable of the wall's colour."""
    width = facade.labels.shape[1]
    over = np.full((ROWS, width, 3), np.median(facade.image[facade.labels == FacadeClass.WALL], axis=0), np.uint8)
    over[:, : round(share * width)] = colour
    labels = np.full((ROWS, width), FacadeClass.WALL, np.uint8)
    return np.concatenate([over, facade.image]), np.concatenate([labels, facade.labels])


@pytest.mark.parametrize("colour", [(245, 246, 248), (150, 185, 230), (40, 80, 150)])
@pytest.mark.parametrize("share", [0.2, 1.0])
def test_sky_beside_and_above_a_gable_is_counted(colour: tuple[int, int, int], share: float) -> None:
    image, labels = put_over(paint_house(), colour, share)
    assert ROWS - 4 <= count_rows(image, labels) <= ROWS + 4


@pytest.mark.parametrize("colour", [(60, 60, 65), (215, 190, 130)])
def test_a_dark_roof_and_a_yellow_attic_are_no_sky(colour: tuple[int, int, int]) -> None:
    assert count_rows(*put_over(paint_house(), colour, 1.0)) == 0


@pytest.mark.parametrize("style", ["brick", "plaster"])
def test_a_facade_without_sky_stays_whole(style: str) -> None:
    facade = paint_house(style)
    assert count_rows(facade.image, facade.labels) == 0


def test_a_floor_with_sky_between_its_windows_is_of_dormers() -> None:
    facade = paint_house()
    found = find_floors_and_bays(facade.labels)
    assert found is not None
    _, bottom = found.floors[0]
    image = facade.image.copy()
    image[:bottom][facade.labels[:bottom] == FacadeClass.WALL] = (245, 246, 248)
    assert count_rows(image, facade.labels) == found.floor_cuts[1]


def test_sky_beside_several_floors_takes_no_floor() -> None:
    facade = paint_house()
    found = find_floors_and_bays(facade.labels)
    assert found is not None
    image = facade.image.copy()
    image[:, : image.shape[1] // 12] = (245, 246, 248)
    assert find_even_sky(image, facade.labels, *np.zeros((2, *facade.labels.shape), bool))[len(image) // 2].any()
    assert count_rows(image, facade.labels) <= found.floors[0][0]


@pytest.mark.parametrize(("share", "is_cut"), [(1 / 8, True), (1 / 25, False)])
def test_sky_of_the_parser_takes_floors_beside_a_tower_and_none_beside_a_slit(share: float, is_cut: bool) -> None:
    facade = paint_house()
    found = find_floors_and_bays(facade.labels)
    assert found is not None
    outside = np.zeros(facade.labels.shape, bool)
    outside[: found.floors[1][1], : round(share * outside.shape[1])] = True
    rows = count_sky_rows(facade.image, facade.labels, outside, outside)
    assert rows == found.floor_cuts[2] if is_cut else rows <= found.floors[0][0]


def test_sky_below_a_border_without_data_is_counted() -> None:
    image, labels = put_over(paint_house(), (245, 246, 248), 1.0)
    hidden = np.zeros(labels.shape, bool)
    hidden[:4] = True
    image[:4] = 0
    assert ROWS - 4 <= count_sky_rows(image, labels, hidden, np.zeros_like(hidden)) <= ROWS + 4
