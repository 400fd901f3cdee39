"""What the imagery benchmark measures with, on small inputs whose answers are known."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from benchmarks.imagery import edge_tilt, psnr, scene_of_walls
from facade_core.imagery.rectify.fusion import ChartView


def striped(turn_deg: float) -> ChartView:
    """Windows on a wall, all turned clockwise."""
    grey = np.full((300, 300), 200, np.uint8)
    for y in range(-100, 400, 60):
        for x in range(-100, 400, 50):
            grey[max(y, 0) : max(y + 40, 0), max(x, 0) : max(x + 30, 0)] = 60
    matrix = cv2.getRotationMatrix2D((150, 150), -turn_deg, 1.0)
    rgb = cv2.cvtColor(cv2.warpAffine(grey, matrix, (300, 300), borderMode=cv2.BORDER_REFLECT), cv2.COLOR_GRAY2RGB)
    return ChartView(rgb, np.ones((300, 300), bool), np.ones((300, 300), np.float32))


@pytest.mark.parametrize("turn", [0.0, 1.5, -2.0])
def test_the_tilt_of_edges_is_that_of_the_wall(turn: float) -> None:
    tilt = edge_tilt(striped(turn))
    assert tilt["level"] == pytest.approx(turn, abs=0.2)
    assert tilt["upright"] == pytest.approx(turn, abs=0.2)


def test_a_blank_wall_has_no_tilt() -> None:
    blank = ChartView(np.full((64, 64, 3), 90, np.uint8), np.ones((64, 64), bool), np.ones((64, 64), np.float32))
    assert edge_tilt(blank) == {"level": None, "upright": None}


def test_exposure_is_no_error_and_noise_is() -> None:
    rng = np.random.default_rng(0)
    truth = rng.integers(20, 200, (50, 50, 3)).astype(np.uint8)
    shown = np.ones((50, 50), bool)
    assert psnr(np.round(truth * 0.8).astype(np.uint8), truth, shown) > 50
    noisy = np.clip(truth + rng.normal(0, 10, truth.shape), 0, 255).astype(np.uint8)
    assert psnr(noisy, truth, shown) == pytest.approx(28, abs=1)


def test_a_wall_looks_at_whoever_sees_its_corners_clockwise() -> None:
    scene = scene_of_walls(np.array([[[0, 0, 3], [4, 0, 3], [4, 0, 0], [0, 0, 0]]], float), 10.0)
    assert scene.charts.normals()[0] == pytest.approx([0, -1, 0])
    assert (scene.placement.width[0], scene.placement.height[0]) == (40, 30)
