"""Pitches of exactly periodic facades are exact to the pixel, with and without noise and a hole."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.papers.floor_pitch import estimate_bay_width, estimate_floor_height

FLOORS, BAYS = 6, 5


def draw_bay(period: int, width: int, course: str) -> np.ndarray:
    """Draw a window with a sill, and a string course that touches the upper or lower border of the bay."""
    bay = np.full((period, width, 3), (180, 170, 150), np.uint8)
    rows, columns = (lambda a, b, side=side: slice(round(a * side), round(b * side)) for side in (period, width))
    bay[rows(0.25, 0.75), columns(0.3, 0.7)] = (60, 70, 90)
    bay[rows(0.78, 0.82), columns(0.25, 0.75)] = 120
    bay[{"upper": rows(0, 0.06), "lower": rows(0.94, 1), "none": rows(0, 0)}[course]] = 230
    return bay


@pytest.mark.parametrize("noise", [0.0, 8.0])
@pytest.mark.parametrize("course", ["none", "upper", "lower"])
@pytest.mark.parametrize("period", [31, 37, 40, 52, 61, 75, 96])
def test_pitches_of_periodic_facades_are_exact(period: int, course: str, noise: float) -> None:
    width = round(0.9 * period)
    rng = np.random.default_rng(period)
    wall = np.tile(draw_bay(period, width, course), (FLOORS, BAYS, 1))
    wall = np.clip(wall + rng.normal(0, noise, wall.shape), 0, 255).astype(np.uint8)
    mask = np.zeros(wall.shape[:2], bool)
    for hidden in (slice(0, 0), slice(2 * period, 3 * period)):
        mask[hidden, width : 2 * width] = True
        assert estimate_floor_height(wall, mask, np.random.default_rng(0)) == period
        assert estimate_bay_width(wall, mask, np.random.default_rng(0)) == width


def test_a_wall_without_repetition_has_no_pitch() -> None:
    ramp = np.repeat(np.linspace(40, 220, 240).astype(np.uint8)[:, None, None], 160, axis=1).repeat(3, axis=2)
    ramp[100:104] = 20
    assert estimate_floor_height(ramp, np.zeros(ramp.shape[:2], bool), np.random.default_rng(0)) is None
