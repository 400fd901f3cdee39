"""The pasted facades of the benchmark of walls from pictures, and its contact sheet."""

from __future__ import annotations

import numpy as np

from benchmarks.photo_walls import SHEET_HEIGHT, SHEET_WIDTH, Pasted, _draw, contact_sheet
from facade_core.core.types import Pose


def test_a_pasted_facade_covers_what_is_behind_it() -> None:
    picture = np.full((100, 100, 3), (200, 10, 20), np.uint8)
    facade = Pasted("parallel", np.array([-2.0, 10.0, 4.0]), np.array([1.0, 0.0, 0.0]), (4.0, 4.0), picture)
    image, before = np.zeros((128, 256, 3), np.uint8), np.full((128, 256), -1)
    _draw(image, before, Pose(0.0, 0.0, 2.0, 0.0), 7, facade)
    rows, columns = np.nonzero(before == 7)
    middle = (rows.mean() + 0.5, columns.mean() + 0.5)
    assert np.allclose(middle, (64, 128), atol=1), "ahead, to the north, at the camera's height"
    wide = 2 * np.degrees(np.arctan2(2, 10)) / 360 * 256
    assert abs(np.ptp(columns) + 1 - wide) <= 2
    assert (image[before == 7] == (200, 10, 20)).all()
    turned = np.full((128, 256), -1)
    _draw(image.copy(), turned, Pose(0.0, 0.0, 2.0, 90.0), 7, facade)
    assert abs(np.nonzero(turned == 7)[1].mean() - 64) <= 1, "to the left of a camera that looks east"


def test_tiles_fill_rows_of_the_sheet() -> None:
    tiles = [(str(n), np.full((50, 200, 3), n, np.uint8)) for n in range(4)]
    sheet = contact_sheet(tiles)
    assert sheet.shape[1] <= SHEET_WIDTH
    assert sheet.shape[0] == 4 * (SHEET_HEIGHT + 28), "two are wider than a row"
