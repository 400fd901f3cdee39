"""Scale at which posed pictures are read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import tasks.stages.shared.images as module
from facade_core.core.types import Lens, Pose
from tasks.stages.shared.images import MAX_LENS_PIXELS_PER_RADIAN, MAX_PIXELS, max_picture_pixels, read_panorama

FINE = Lens((8688, 5792), (5792.0, 5792.0), (4344.0, 2896.0))


def test_a_picture_of_a_lens_has_no_more_pixels_a_radian_than_walls_need() -> None:
    fine = Pose(0.0, 0.0, 2.0, 0.0, lens=FINE)
    shrink = MAX_LENS_PIXELS_PER_RADIAN / 5792
    assert max_picture_pixels(fine) == pytest.approx(8688 * 5792 * shrink**2, rel=1e-3)
    assert max_picture_pixels(Pose(0.0, 0.0, 80.0, 0.0, -60.0, lens=FINE)) == MAX_PIXELS, "of an aerial one roofs do"
    assert max_picture_pixels(Pose(0.0, 0.0, 2.0, 0.0)) == MAX_PIXELS
    phone = Lens((4000, 3000), (2500.0, 2500.0), (2000.0, 1500.0))
    assert max_picture_pixels(Pose(0.0, 0.0, 2.0, 0.0, lens=phone)) >= 4000 * 3000


def test_a_fine_picture_is_reduced_while_it_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MAX_LENS_PIXELS_PER_RADIAN", 100)
    path = tmp_path / "a.jpg"
    Image.fromarray(np.full((600, 800, 3), 90, np.uint8)).save(path)
    lens = Lens((800, 600), (400.0, 400.0), (400.0, 300.0))
    assert read_panorama(path, max_picture_pixels(Pose(0.0, 0.0, 2.0, 0.0, lens=lens))).shape == (150, 200, 3)
    assert read_panorama(path).shape == (600, 800, 3)
