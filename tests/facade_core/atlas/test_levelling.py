"""Seams go, known texels stay, and mipmaps meet nothing but known colours."""

from __future__ import annotations

import numpy as np
import pytest

from facade_core.core.levelling import fill_unknown_colours, fill_unknown_values, level_seam_colours


def halves(left: int, right: int) -> tuple[np.ndarray, np.ndarray]:
    grain = np.random.default_rng(0).integers(-10, 11, (60, 90, 1))
    fixed = np.zeros((60, 90), bool)
    fixed[:, :40] = True
    colour = np.where(fixed[..., None], left, right) + grain
    return colour.repeat(3, axis=2).astype(np.uint8), fixed


def test_the_seam_goes_and_the_grain_stays() -> None:
    colour, fixed = halves(150, 90)
    levelled = level_seam_colours(colour, fixed, ~fixed, reach=10)
    np.testing.assert_array_equal(levelled[fixed], colour[fixed])
    assert abs(levelled[:, 40:42].mean() - levelled[:, 36:40].mean()) < 8
    change = levelled.astype(int) - colour
    assert change[:, 40].mean() > 52
    assert 15 < change[:, 50].mean() < 30
    assert change[:, 88].mean() < 2
    assert abs(levelled[:, 45].std() - colour[:, 45].std()) < 2


def test_an_offset_is_smooth_and_goes_over_from_one_border_to_another() -> None:
    colour = np.full((40, 120, 3), 100, np.uint8)
    fixed = np.zeros((40, 120), bool)
    fixed[:, :10] = fixed[:, 110:] = True
    colour[:, :10], colour[:, 110:] = 140, 80
    rows = level_seam_colours(colour, fixed, ~fixed, reach=1e6).astype(int).mean(axis=(0, 2))[10:110]
    assert abs(rows[0] - 140) < 4
    assert abs(rows[-1] - 80) < 4
    assert np.abs(np.diff(rows)).max() < 4
    assert abs(rows[50] - 110) < 12


def test_a_patch_of_another_material_does_not_tint_the_wall() -> None:
    colour = np.full((80, 80, 3), 180, np.uint8)
    fixed = np.zeros((80, 80), bool)
    fixed[:3, :3], colour[:3, :3] = True, 0
    levelled = level_seam_colours(colour, fixed, ~fixed, reach=10).astype(int)
    assert levelled[~fixed].min() >= 180 - 64
    assert (levelled[40:, 40:] >= 176).all()


def test_apart_or_alone_nothing_changes() -> None:
    colour, fixed = halves(150, 90)
    apart = fixed.copy()
    apart[:, 38:40] = False
    free = ~fixed
    np.testing.assert_array_equal(level_seam_colours(colour, apart, free, reach=10), colour)
    np.testing.assert_array_equal(level_seam_colours(colour, np.zeros_like(fixed), ~fixed, reach=10), colour)


def test_means_of_squares_hold_only_known_colours() -> None:
    """A red island in the dark: at every level of a mipmap that touches it, and beyond, there is red."""
    rng = np.random.default_rng(1)
    known = np.zeros((100, 77), bool)
    known[30:61, 20:50] = True
    values = np.where(known[..., None], [200, 40, 10], 0).astype(np.uint8)
    level_ = fill_unknown_values(values, known)
    assert level_.shape == (100, 77, 3)
    np.testing.assert_array_equal(level_[known], values[known])
    assert np.abs(level_ - [200, 40, 10]).max() < 1e-3
    two = known & (rng.random(known.shape) < 0.5)
    assert np.isfinite(fill_unknown_values(values, two)).all()
    assert fill_unknown_values(values, np.zeros_like(known)).max() == 0


@pytest.mark.parametrize("size", [(1, 1), (1, 7), (33, 64), (130, 75)])
@pytest.mark.parametrize("share", [0.0, 0.02, 0.6])
def test_what_is_not_known_is_filled_as_it_is_spread(size: tuple[int, int], share: float) -> None:
    draw = np.random.default_rng(size[1])
    colour, known = draw.integers(0, 256, (*size, 3), np.uint8), draw.random(size) < share
    known[: size[0] // 2] = False  # far from all that is known
    expected = np.where(known[..., None], colour, np.round(fill_unknown_values(colour, known)).astype(np.uint8))
    np.testing.assert_array_equal(fill_unknown_colours(colour, known), expected)
