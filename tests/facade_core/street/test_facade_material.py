"""A building's wall by its facade: its colour out of shadow, bricks by their courses."""

from __future__ import annotations

import numpy as np
import pytest

from facade_core.core.labels import FacadeClass
from facade_core.facade.wall_material import lit_colour, measure_wall_material
from facade_core.street.materials.procedural import brick_tone, plaster_tone

DENSITY = 32.0
COLOUR = np.array([168.0, 132.0, 96.0])


def facade(laid: bool, density: float = DENSITY) -> tuple[np.ndarray, np.ndarray]:
    """8 x 6 m with two windows, the left third in shadow."""
    rows, columns = round(6 * density), round(8 * density)
    x, y = (a.ravel() for a in np.meshgrid((np.arange(columns) + 0.5) / density, (np.arange(rows) + 0.5) / density))
    tone, mortar, side = np.empty(len(x)), np.zeros(len(x)), np.full(len(x), 1 / density)
    if laid:
        brick_tone(x, y, 20 - y, side, 3, mortar, tone)
    else:
        plaster_tone(x, y, 20 - y, side, 3, tone)
    colour = (tone[:, None] * (COLOUR + mortar[:, None] * (185 - COLOUR))).reshape(rows, columns, 3)
    colour[:, : columns // 3] *= 0.5
    labels = np.full((rows, columns), FacadeClass.WALL, np.uint8)
    labels[rows // 2 : rows // 2 + rows // 4, columns // 2 : columns // 2 + columns // 8] = FacadeClass.WINDOW
    colour[labels == FacadeClass.WINDOW] = (20, 30, 40)
    return np.clip(colour, 0, 255).astype(np.uint8), labels


def test_the_colour_is_that_of_the_lit_wall() -> None:
    wall = measure_wall_material(*facade(laid=False), DENSITY)
    assert wall is not None
    assert wall.colour == pytest.approx(COLOUR, rel=0.06)
    assert not wall.brick


def test_bricks_are_told_by_their_courses_where_texels_show_them() -> None:
    wall = measure_wall_material(*facade(laid=True), DENSITY)
    assert wall is not None
    assert wall.brick
    coarse = measure_wall_material(*facade(laid=True, density=16.0), 16.0)
    assert coarse is not None
    assert not coarse.brick


def test_of_a_facade_that_is_all_windows_nothing_is_known() -> None:
    image, labels = facade(laid=False)
    assert measure_wall_material(image, np.full_like(labels, FacadeClass.WINDOW), DENSITY) is None


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_texels_have_a_colour_too(count: int) -> None:
    pixels = np.array([(200, 180, 160), (40, 30, 20), (90, 80, 70)], np.uint8)[:count]
    found = lit_colour(pixels)
    assert ((found >= pixels.min(axis=0)) & (found <= pixels.max(axis=0))).all()
