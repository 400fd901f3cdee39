"""What `benchmarks.poses` finds on walls that were moved by so much."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from benchmarks.poses import _compare
from facade_core.imagery.rectify.fusion import ChartView, fuse_views


def wall(right: int, down: int) -> ChartView:
    """A wall of 20 x 16 m that no part of is like another, moved by texels; what it does not show is not seen."""
    coarse = np.random.default_rng(1).integers(0, 256, (32, 40, 3), dtype=np.uint8)
    whole = cv2.resize(coarse, (200, 160), interpolation=cv2.INTER_NEAREST)
    moved = np.array([[1, 0, right], [0, 1, down]], np.float64)
    seen = cv2.warpAffine(np.ones((160, 200), np.uint8), moved, (200, 160)) > 0
    return ChartView(cv2.warpAffine(whole, moved, (200, 160)), seen, np.ones(seen.shape, np.float32))


def test_what_a_shift_brings_is_told_apart() -> None:
    told: dict[str, list[float]] = {"psnr": [], "ssim": [], "registered": [], "shift_m": []}
    _compare(told, wall(0, 0), fuse_views([wall(5, -6)]), 10.0)
    assert told["shift_m"] == pytest.approx([np.hypot(5, 6) / 10.0])
    assert told["ssim"][0] < 0.5
    assert told["registered"][0] > 0.95
