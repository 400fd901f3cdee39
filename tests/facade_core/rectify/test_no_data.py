"""Corners without data of rectified pictures are found, and nothing that is only dark or even."""

from __future__ import annotations

import io

import cv2
import numpy as np
import pytest
from PIL import Image

from benchmarks.painter.facade import paint_facade
from benchmarks.painter.styles import STYLES
from facade_core.imagery.rectify.no_data import NO_DATA_RIM, no_data_mask


def warp_facade(lean: float, fill: int = 0, metres_per_pixel: float = 0.05) -> tuple[np.ndarray, np.ndarray]:
    """A painted facade as a rectification leaves it, sheared, as a JPEG; and what of it is no part of the picture."""
    painted = paint_facade(
        (10.0, 14.0), floors=3, columns=4, style=STYLES[0], metres_per_pixel=metres_per_pixel, seed=3
    )
    image = painted.image
    height, width = image.shape[:2]
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float32)
    moved = corners + np.array([[lean, 0], [0, lean], [0, -lean / 2], [lean / 3, 0]], np.float32)
    turn = cv2.getPerspectiveTransform(corners, moved)
    beside = (
        cv2.warpPerspective(np.ones((height, width), np.uint8), turn, (width, height), flags=cv2.INTER_NEAREST) == 0
    )
    file = io.BytesIO()
    picture = cv2.warpPerspective(image, turn, (width, height), borderValue=(fill, fill, fill))
    Image.fromarray(picture).save(file, "JPEG", quality=85)
    return np.asarray(Image.open(file)), beside


@pytest.mark.parametrize(("lean", "share"), [(12.0, 0.75), (30.0, 0.97), (60.0, 0.97)])
def test_what_a_warp_left_black_is_found(lean: float, share: float) -> None:
    image, beside = warp_facade(lean)
    found = no_data_mask(image)
    assert found[beside].mean() > share
    reach = 2 * (NO_DATA_RIM + 3) + 1
    assert not found[cv2.dilate(beside.astype(np.uint8), np.ones((reach, reach), np.uint8)) == 0].any()


@pytest.mark.parametrize("fill", [18, 130])
def test_what_a_warp_filled_with_one_colour_is_found(fill: int) -> None:
    image, beside = warp_facade(200.0, fill, 0.015)
    found = no_data_mask(image)
    assert found[beside].mean() > 0.97
    assert found[~beside].mean() < 0.1


def test_a_fill_within_a_thin_frame_is_found_and_an_even_sky_is_not() -> None:
    rng = np.random.default_rng(0)
    image = rng.integers(60, 200, (400, 300, 3), np.uint8)
    image[:120, :100] = np.linspace(200, 190, 100).round().astype(np.uint8)[:, None]
    image[-60:, :] = 13
    image[-3:, :] = 236
    found = no_data_mask(image)
    assert found[-50:-10].all()
    assert not found[:300].any()
    image[20:60, 4:60] = 13  # a window near a corner, which touches no side
    assert not no_data_mask(image)[:300].any()


def test_the_wall_of_a_drawing_in_one_colour_is_kept() -> None:
    image = np.full((300, 240, 3), (196, 120, 90), np.uint8)
    image[240:] = (90, 90, 90)
    for row in range(4):
        for column in range(4):
            y, x = 14 + 56 * row, 14 + 56 * column
            image[y : y + 44, x : x + 44] = (60, 70, 90)
    assert (image == (196, 120, 90)).all(axis=2).mean() < 0.5
    assert not no_data_mask(image)[:220].any()


@pytest.mark.parametrize("style", STYLES)
def test_nothing_of_a_whole_picture_is_taken_for_a_corner(style: str) -> None:
    image = paint_facade((10.0, 14.0), floors=3, columns=4, style=style, metres_per_pixel=0.05, seed=4).image
    assert not no_data_mask(image).any()


def test_what_is_dark_at_the_border_is_kept() -> None:
    image = np.full((200, 300, 3), 150, np.uint8)
    image[120:, 100:160] = 4
    assert not no_data_mask(image).any()
    image[100:, 230:] = 4  # in a corner at the foot, and upright
    assert not no_data_mask(image).any()
    image[:60, :90] = 0  # in a corner above
    assert no_data_mask(image)[:60, :90].all()
    assert not no_data_mask(image)[100:].any()
    image[:, 280:] = 0  # along a whole side
    assert no_data_mask(image)[:, 280:].all()
    assert not no_data_mask(np.zeros_like(image)).any()
