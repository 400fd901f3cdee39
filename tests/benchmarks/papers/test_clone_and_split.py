"""The floors paper's own inpainting: floor height by lines, clones from whole floors away, patches split without a source."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from benchmarks.papers.clone_and_split import clone_and_split
from benchmarks.papers.floor_pitch import estimate_bay_width, estimate_floor_height

FLOOR, BAY = 40, 36


def repeated_wall() -> np.ndarray:
    """Five floors of four bays, each a window with a bright frame and a sill."""
    bay = np.full((FLOOR, BAY, 3), (180, 170, 150), np.uint8)
    bay[10:32, 10:26] = 235
    bay[12:30, 12:24] = (50, 60, 80)
    bay[34:36, 6:30] = 120
    return np.tile(bay, (5, 4, 1))


def test_pitches() -> None:
    wall, rng = repeated_wall(), np.random.default_rng(0)
    mask = np.zeros(wall.shape[:2], bool)
    mask[75:125, 40:75] = True
    assert estimate_floor_height(wall, mask, rng) == pytest.approx(FLOOR, abs=1)
    assert estimate_bay_width(wall, mask, rng) == pytest.approx(BAY, abs=1)
    flat = np.full((100, 100, 3), 120, np.uint8)
    assert estimate_floor_height(flat, np.zeros((100, 100), bool), rng) is None


def test_a_hole_is_cloned_from_whole_floors_away_and_split_where_no_source_covers_it() -> None:
    wall = repeated_wall()
    for rows, columns in ((slice(75, 125), slice(40, 75)), (slice(30, 200), slice(50, 90))):
        mask = np.zeros(wall.shape[:2], bool)
        mask[rows, columns] = True
        spoiled = np.where(mask[..., None], np.uint8(255), wall)
        filled = clone_and_split(spoiled, mask, np.random.default_rng(0))
        np.testing.assert_array_equal(filled[~mask], wall[~mask])
        error, diffused = (
            np.abs(result[mask].astype(int) - wall[mask]).mean()
            for result in (filled, cv2.inpaint(spoiled, mask.astype(np.uint8), 3, cv2.INPAINT_TELEA))
        )
        assert error < 0.1 * diffused
