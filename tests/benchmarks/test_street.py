"""What the street benchmark counts, on inputs whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.street import seams
from benchmarks.street.truth import interval, psnr


def test_psnr_counts_only_where_asked() -> None:
    truth = np.zeros((4, 4, 3), np.uint8)
    image = truth.copy()
    image[:2] = 255
    where = np.zeros((4, 4), bool)
    where[:2] = True
    assert psnr(image, truth, where) == pytest.approx(0.0)
    image[:2] = 16
    assert psnr(image, truth, where) == pytest.approx(20 * np.log10(255 / 16))


def test_the_interval_holds_the_mean_and_shrinks_with_more_facades() -> None:
    rng = np.random.default_rng(0)
    few, many = interval(rng.normal(20, 1, 8)), interval(rng.normal(20, 1, 800))
    for one in (few, many):
        assert one["low"] < one["mean"] < one["high"]
    assert many["high"] - many["low"] < 0.3 * (few["high"] - few["low"])


def test_a_seam_is_what_differs_more_across_than_beside() -> None:
    ramp = np.tile((10 + 2 * np.arange(40))[None, :, None], (5, 1, 3)).astype(np.uint8)
    left, right = ramp[:, :20], ramp[:, 20:]
    assert seams._seam([left, right]) == pytest.approx(1.0)
    assert seams._seam([left, right + 10]) == pytest.approx(6.0)
