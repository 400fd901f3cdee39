"""Eq. 1 from the small state against the direct formula."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facade_core.street.propagation.blend import BlendState, blend_views
from tests.facade_core.street.added_views import add_views


def direct(d: np.ndarray, rgb: np.ndarray, proper: np.ndarray, view: np.ndarray) -> np.ndarray:
    """Eq. 1 as the design pins it, written out."""
    if not proper.any():
        return rgb[min(range(len(d)), key=lambda i: (d[i], view[i]))].astype(float)
    d, rgb = d[proper].astype(float), rgb[proper].astype(float)
    weight = np.ones(len(d))
    if len(d) > 1 and d.sum() > 0:
        weight = (np.clip(1 - d / d.sum(), 0.3, 0.7) - 0.3) / 0.4
    return (weight[:, None] * rgb).sum(axis=0) / weight.sum()


def blended(d: np.ndarray, rgb: np.ndarray, proper: np.ndarray, view: np.ndarray) -> np.ndarray:
    state = BlendState.allocate(1)
    add_views(state, np.zeros(len(d), np.int64), d, proper, view, rgb)
    colour, views = blend_views(state)
    assert views[0] == (proper.sum() or 1)
    return colour[0]


@settings(max_examples=300)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 30),
    st.sampled_from([0, 1, 100, 7500]),
    st.sampled_from([0.0, 0.5, 1.0]),
)
def test_equals_the_direct_formula_in_any_order(seed: int, n: int, largest: int, improper: float) -> None:
    rng = np.random.default_rng(seed)
    d = rng.integers(0, largest + 1, n)
    rgb = rng.integers(0, 256, (n, 3)).astype(np.uint8)
    proper = rng.random(n) >= improper
    view = rng.permutation(n)
    first = blended(d, rgb, proper, view)
    assert np.abs(first - direct(d, rgb, proper, view)).max() <= 0.5 + 1e-6
    order = rng.permutation(n)
    np.testing.assert_array_equal(blended(d[order], rgb[order], proper[order], view[order]), first)


def test_distances_beyond_16_bits_have_room() -> None:
    state = BlendState.allocate(1, max_distance_mm=200_000)
    rgb = np.array([[9, 9, 9], [5, 5, 5]], np.uint8)
    texel = np.zeros(2, np.int64)
    add_views(state, texel, np.array([150_000, 90_000]), np.zeros(2, bool), np.array([1, 2]), rgb)
    np.testing.assert_array_equal(blend_views(state)[0][0], [5, 5, 5])
    assert state.top_distance[0, 0] == 90_000


def test_a_texel_takes_33_bytes() -> None:
    assert sum(a.nbytes for a in BlendState.allocate(1000)) == 33_000


def test_all_distances_zero_is_the_plain_average() -> None:
    rgb = np.array([[0, 0, 0], [100, 200, 50]], np.uint8)
    np.testing.assert_array_equal(blended(np.zeros(2, int), rgb, np.ones(2, bool), np.arange(2)), [50, 100, 25])


def test_two_views_far_one_eliminated() -> None:
    """Shares 0.9 and 0.1: the far view's weight clamps to 0.3 and maps to nothing."""
    rgb = np.array([[200, 0, 0], [0, 100, 0]], np.uint8)
    np.testing.assert_array_equal(blended(np.array([900, 100]), rgb, np.ones(2, bool), np.arange(2)), [0, 100, 0])


def test_stand_in_goes_when_a_proper_view_comes() -> None:
    state = BlendState.allocate(1)
    rgb = np.array([[9, 9, 9], [5, 5, 5], [200, 100, 0]], np.uint8)
    zero = np.zeros(1, np.int64)
    add_views(state, zero, np.array([9000]), np.array([False]), np.array([1]), rgb[:1])
    add_views(state, zero, np.array([8000]), np.array([False]), np.array([2]), rgb[1:2])
    np.testing.assert_array_equal(blend_views(state)[0][0], [5, 5, 5])
    add_views(state, zero, np.array([10]), np.array([True]), np.array([3]), rgb[2:])
    np.testing.assert_array_equal(blend_views(state)[0][0], [200, 100, 0])


def test_unseen_texel_has_no_views() -> None:
    colour, views = blend_views(BlendState.allocate(2))
    assert views.tolist() == [0, 0]
    assert colour.max() == 0


@pytest.mark.parametrize("n", [1, 2, 3])
def test_one_colour_stays_that_colour(n: int) -> None:
    rgb = np.tile(np.array([[17, 99, 240]], np.uint8), (n, 1))
    np.testing.assert_array_equal(blended(np.arange(n) * 700, rgb, np.ones(n, bool), np.arange(n)), [17, 99, 240])
