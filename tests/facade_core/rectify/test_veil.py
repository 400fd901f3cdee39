"""A purple veil goes where dark pixels prove it; other pictures stay as they are."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.painter.facade import paint_facade
from facade_core.core.linear_light import linear_to_srgb, srgb_to_linear
from facade_core.imagery.rectify.veil import remove_veil

PURPLE, GREY, BLUE = (0.1, 0.06, 0.12), (0.08, 0.08, 0.08), (0.06, 0.08, 0.11)


def paint_picture(wall: tuple[int, int, int]) -> np.ndarray:
    """A wall with dark openings below a white sky, and noise."""
    rng = np.random.default_rng(3)
    picture = np.full((640, 960, 3), wall, np.float64)
    for y in range(160, 640, 40):
        for x in range(0, 960, 30):
            picture[y + 8 : y + 30, x + 8 : x + 22] = 34
    picture[:120] = 255
    return np.clip(picture + rng.normal(0, 3, picture.shape), 0, 255).astype(np.uint8)


def add_veil(picture: np.ndarray, colour: tuple[float, ...]) -> np.ndarray:
    """Veil of a colour in linear light that fades downwards."""
    share = np.exp(-np.maximum(np.arange(len(picture)) - 120, 0) / 150)[:, None, None]
    veil = share * np.array(colour)
    return linear_to_srgb(srgb_to_linear(picture) * (1 - veil) + veil)


@pytest.mark.parametrize("wall", [(120, 70, 60), (170, 160, 140)])
def test_a_purple_veil_goes(wall: tuple[int, int, int]) -> None:
    picture = paint_picture(wall)
    veiled = add_veil(picture, PURPLE)
    found = remove_veil(veiled)
    before, after = (np.abs(one[120:].astype(int) - picture[120:]).mean() for one in (veiled, found))
    assert after < 0.5 * before
    assert (found[:100][veiled[:100] == 255] == 255).all(), "white stays"


@pytest.mark.parametrize("colour", [GREY, BLUE])
def test_a_veil_that_may_be_light_of_the_place_stays(colour: tuple[float, ...]) -> None:
    veiled = add_veil(paint_picture((120, 70, 60)), colour)
    np.testing.assert_array_equal(remove_veil(veiled), veiled)


@pytest.mark.parametrize("wall", [(120, 70, 60), (170, 160, 140), (110, 80, 130), (60, 110, 60)])
def test_a_picture_without_a_veil_stays(wall: tuple[int, int, int]) -> None:
    picture = paint_picture(wall)
    np.testing.assert_array_equal(remove_veil(picture), picture)


def test_a_purple_surface_without_dark_pixels_stays() -> None:
    plain = np.full((400, 640, 3), (110, 70, 130), np.uint8)
    np.testing.assert_array_equal(remove_veil(plain), plain)
    tiny = plain[:9, :9]
    np.testing.assert_array_equal(remove_veil(tiny), tiny)


def test_a_painted_facade_stays() -> None:
    image = paint_facade((12.0, 9.0), floors=3, columns=4, style="jugend", metres_per_pixel=0.02, seed=2).image
    np.testing.assert_array_equal(remove_veil(image), image)


@pytest.mark.parametrize("colour", [(165, 0, 165), (128, 0, 128), (110, 40, 120)])
def test_a_purple_thing_leaves_the_wall_as_it_is(colour: tuple[int, int, int]) -> None:
    picture = paint_picture((150, 110, 90))
    picture[200:400, 300:500] = colour
    picture[200:400:25, 300:500] = 205
    found = remove_veil(picture)
    beside = np.s_[200:400, 520:900]
    assert np.abs(found[beside].astype(int) - picture[beside]).mean() < 1


def test_shaded_brick_stays() -> None:
    picture = np.full((640, 960, 3), (185, 125, 105), np.uint8)
    down, across = np.mgrid[:640, :960]
    picture[across > 300 + 0.6 * down] = (75, 52, 60)
    found = remove_veil(picture)
    assert np.abs(found.astype(int) - picture).mean() < 1
