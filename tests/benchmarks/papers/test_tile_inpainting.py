"""Inpainting of the tiles paper (section 4.3): visible tiles stay, hidden ones are copies of visible ones."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from benchmarks.papers.tile_inpainting import inpaint_by_tiles
from facade_core.core.errors import ImageError
from tests.facade_core.texture.conftest import draw


@pytest.fixture(scope="module")
def facade():
    return draw()


def error(a: np.ndarray, b: np.ndarray, mask: np.ndarray) -> float:
    return float(np.abs(a[mask].astype(float) - b[mask]).mean())


def test_a_hidden_window_comes_back_and_known_pixels_stay(facade) -> None:
    hole = np.zeros(facade.labels.shape, bool)
    hole[75:125, 40:75] = True
    image = np.where(hole[..., None], np.array([255, 0, 255], np.uint8), facade.image)
    filled = inpaint_by_tiles(image, hole, labels=facade.labels)
    np.testing.assert_array_equal(filled[~hole], image[~hole])
    telea = cv2.inpaint(image, hole.astype(np.uint8), 3, cv2.INPAINT_TELEA)
    assert error(filled, facade.image, hole) < 0.4 * error(telea, facade.image, hole)


def test_what_a_hole_was_painted_with_does_not_show(facade) -> None:
    mask = np.zeros(facade.labels.shape, bool)
    mask[60:140, 40:130] = True
    one, other = (
        inpaint_by_tiles(np.where(mask[..., None], np.uint8(paint), facade.image), mask, labels=facade.labels)
        for paint in (0, 255)
    )
    np.testing.assert_array_equal(one, other)


def test_a_seed_gives_the_same_picture(facade) -> None:
    mask = np.zeros(facade.labels.shape, bool)
    mask[60:140, 40:130] = True
    one, other = (inpaint_by_tiles(facade.image, mask, labels=facade.labels, seed=3) for _ in range(2))
    np.testing.assert_array_equal(one, other)


def test_a_whole_tile_must_be_visible(facade) -> None:
    mask = np.ones(facade.labels.shape, bool)
    mask[::37, ::31] = False
    with pytest.raises(ImageError, match="no whole tile"):
        inpaint_by_tiles(facade.image, mask, labels=facade.labels)
