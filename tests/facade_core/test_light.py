"""Colours as linear light and back."""

from __future__ import annotations

import numpy as np

from facade_core.core.linear_light import linear_to_srgb, srgb_to_linear


def test_srgb_is_the_standards() -> None:
    values = np.array([0.0, 0.001, 0.2, 1.0, 3.0], np.float32)
    np.testing.assert_array_equal(linear_to_srgb(values), np.rint(255 * np.array([0, 0.01292, 0.48453, 1, 1])))
    every = np.arange(256, dtype=np.uint8)
    np.testing.assert_array_equal(linear_to_srgb(srgb_to_linear(every)), every)
