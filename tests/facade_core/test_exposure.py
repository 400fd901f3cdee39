"""Walls of one building in one exposure: those of one hue, within bounds, by a curve that keeps white."""

from __future__ import annotations

import numpy as np
import pytest

from facade_core.facade.exposure import MAX_SHADE_RATIO, MAX_SLOPE, apply_tone_curve, level_wall_colours

BRICK, PLASTER = np.array([101.0, 82, 83]), np.array([152.0, 138, 126])
# Walls of one building at the IJ, in two panoramas.
RED_BRICK, TAN_BRICK = np.array([76.0, 64, 67]), np.array([109.0, 101, 87])


def lighten_colour(colour: np.ndarray, slope: np.ndarray) -> np.ndarray:
    return apply_tone_curve(np.rint(colour).astype(np.uint8)[None, None], slope)[0, 0].astype(float)


def test_the_darker_of_two_walls_comes_to_the_lighter_one() -> None:
    dark = BRICK * (0.7, 0.7, 0.75)  # in the shade: bluer
    slopes = level_wall_colours([BRICK, dark], ["a", "b"])
    np.testing.assert_array_equal(slopes[0], 1)
    assert np.abs(lighten_colour(dark, slopes[1]) - BRICK).max() < 3


def test_sun_and_shade_of_one_picture_stay_within_a_bound() -> None:
    shaded, black = PLASTER * 0.75, PLASTER * 0.4
    slopes = level_wall_colours([PLASTER, shaded, black], ["a", "a", "a"])
    np.testing.assert_array_equal(slopes[:2], 1)
    assert np.abs(lighten_colour(black, slopes[2]) * MAX_SHADE_RATIO - PLASTER).max() < 6


def test_a_darker_picture_is_lightened_with_its_shade() -> None:
    lit, shaded = PLASTER * 0.7, PLASTER * 0.7 * 0.75
    slopes = level_wall_colours([PLASTER, lit, shaded], ["a", "b", "b"])
    found = [lighten_colour(colour, slope) for colour, slope in zip((lit, shaded), slopes[1:], strict=True)]
    assert np.abs(found[0] - PLASTER).max() < 3
    assert found[1].mean() / found[0].mean() == pytest.approx(0.75, abs=0.08), "as its picture shows it"


def test_the_lift_amplifies_noise_no_more_than_light() -> None:
    tones = np.arange(4, 251)
    lit = apply_tone_curve(np.repeat(np.arange(256, dtype=np.uint8)[None, :, None], 3, axis=2), np.full(3, MAX_SLOPE))
    light = lit[0, :, 0].astype(float)
    growth = (light[tones + 4] - light[tones - 4]) / 8
    assert (growth <= light[tones] / tones + 0.15).all()


def test_walls_of_another_material_keep_their_exposure() -> None:
    np.testing.assert_array_equal(level_wall_colours([BRICK, PLASTER], ["a", "b"]), 1)
    np.testing.assert_array_equal(level_wall_colours([RED_BRICK, TAN_BRICK], ["a", "b"]), 1)
    np.testing.assert_array_equal(level_wall_colours([BRICK], ["a"]), 1)
    assert level_wall_colours([], []).shape == (0, 3)


def test_a_wall_at_night_is_lightened_within_bounds() -> None:
    slopes = level_wall_colours([PLASTER, PLASTER / 8], ["a", "b"])
    assert slopes[1].mean() == pytest.approx(MAX_SLOPE, rel=0.05)
    assert (lighten_colour(PLASTER / 8, slopes[1]) < PLASTER / 3).all()
    assert np.isfinite(level_wall_colours([np.zeros(3), np.full(3, 255.0)], ["a", "b"])).all()


def test_the_curve_keeps_black_and_white_and_the_order() -> None:
    ramp = np.repeat(np.arange(256, dtype=np.uint8)[None, :, None], 3, axis=2)
    lit = apply_tone_curve(ramp, np.array([2.0, 1.0, 1.5]))
    assert (lit[0, [0, -1]] == ramp[0, [0, -1]]).all()
    assert (np.diff(lit[0].astype(int), axis=0) >= 0).all()
    assert lit[0, 10].tolist() == [20, 10, 15]
