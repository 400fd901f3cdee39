"""Slope of the level lines of a rectified facade."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from benchmarks.painter.facade import paint_facade
from facade_core.imagery.rectify.level_lines import find_slope

PAINTED = paint_facade((14.0, 12.0), floors=4, columns=5, style="haussmann", metres_per_pixel=0.02, seed=4).image
HEIGHT, WIDTH = PAINTED.shape[:2]
NOTHING = np.zeros((HEIGHT, WIDTH), bool)


def turn(degrees: float) -> np.ndarray:
    """The facade sheared, so that its level lines slope."""
    shear = np.float32([[1, 0, 0], [np.tan(np.radians(degrees)), 1, 0]])
    return cv2.warpAffine(PAINTED, shear, (WIDTH, HEIGHT), borderMode=cv2.BORDER_REFLECT)


@pytest.mark.parametrize("degrees", [-12.0, 5.0])
def test_the_slope_is_that_of_the_facade(degrees: float) -> None:
    assert find_slope(turn(degrees), NOTHING) == pytest.approx(abs(degrees), abs=0.3)


def test_a_level_facade_has_no_slope() -> None:
    assert find_slope(PAINTED, NOTHING) is None


def test_lines_of_what_is_hidden_do_not_count() -> None:
    picture, hidden = PAINTED.copy(), NOTHING.copy()
    hidden[:, : 3 * WIDTH // 4] = True
    picture[hidden] = turn(12.0)[hidden]
    assert find_slope(picture, hidden) is None
    assert find_slope(picture, NOTHING) is not None


def test_few_lines_say_nothing() -> None:
    assert find_slope(np.full((HEIGHT, WIDTH, 3), 120, np.uint8), NOTHING) is None
    picture = np.full((HEIGHT, WIDTH, 3), 120, np.uint8)
    cv2.line(picture, (50, 50), (WIDTH - 50, 200), (0, 0, 0), 5)
    assert find_slope(picture, NOTHING) is None
