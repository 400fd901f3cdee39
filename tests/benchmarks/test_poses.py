"""What `benchmarks.poses` and its trial find on walls that were moved by so much."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from benchmarks.joint_poses import DENSITY, _patches
from benchmarks.poses import _compare
from facade_core.rectify import View, fuse_views


def wall(right: int, down: int) -> View:
    """A wall of 20 x 16 m that no part of is like another, moved by texels; what it does not show is not seen."""
    coarse = np.random.default_rng(1).integers(0, 256, (32, 40, 3), dtype=np.uint8)
    whole = cv2.resize(coarse, (200, 160), interpolation=cv2.INTER_NEAREST)
    moved = np.array([[1, 0, right], [0, 1, down]], np.float64)
    seen = cv2.warpAffine(np.ones((160, 200), np.uint8), moved, (200, 160)) > 0
    return View(cv2.warpAffine(whole, moved, (200, 160)), seen, np.ones(seen.shape, np.float32))


def test_patches_lie_as_far_off_as_the_wall_was_moved() -> None:
    found = _patches(wall(0, 0), wall(-9, 14), reach=2.6)
    assert len(found) > 10
    for (x, y), (u, v) in found:
        assert (x - u, y - v) == pytest.approx((9, -14), abs=0.3)


def test_what_a_shift_brings_is_told_apart() -> None:
    told: dict[str, list[float]] = {"psnr": [], "ssim": [], "registered": [], "shift_m": []}
    _compare(told, wall(0, 0), fuse_views([wall(5, -6)]), DENSITY)
    assert told["shift_m"] == pytest.approx([np.hypot(5, 6) / DENSITY])
    assert told["ssim"][0] < 0.5
    assert told["registered"][0] > 0.95
