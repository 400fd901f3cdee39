"""Pictures that are said to be full equirectangular panoramas."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from benchmarks.painter.street_truth import render_street_panorama, synthetic_street
from facade_core.core.errors import ImageError
from facade_core.core.types import Pose
from facade_core.imagery.rectify.full_circle import check_full_panorama


@pytest.fixture(scope="module")
def whole() -> np.ndarray:
    street = synthetic_street(4, seed=3, texels_per_metre=8.0)
    x, y = street.world_point(0.45 * street.length, 1.0)
    return render_street_panorama(street, Pose(float(x), float(y), 2.5, 40.0), 1024)


def fisheye(image: np.ndarray, middles: tuple[float, ...]) -> np.ndarray:
    """What a panorama (h, 2 h) shows within circles of its height, black around them."""
    height, width = image.shape[:2]
    y, x = np.indices((height, width)) + 0.5
    away = np.min([np.hypot(x - share * width, y - height / 2) for share in middles], axis=0)
    return np.where((away < height / 2)[..., None], np.roll(image, 77, axis=1), np.uint8(3))


def test_a_panorama_is_one(whole: np.ndarray) -> None:
    check_full_panorama(whole)
    check_full_panorama(np.roll(whole, 300, axis=1))
    night = whole // 12
    check_full_panorama(night)


def test_one_that_is_cut_off_is_none(whole: np.ndarray) -> None:
    height, width = whole.shape[:2]
    low = whole[height // 4 : height // 4 * 3, width // 5 : width // 5 + width // 2]
    with pytest.raises(ImageError, match=r"is cut off, or no panorama: .*GPano tags, or remove it"):
        check_full_panorama(low)
    with pytest.raises(ImageError, match="its first row, which is one point of the sky, varies by"):
        check_full_panorama(np.roll(whole, height // 2, axis=0))


def test_a_fisheye_picture_is_none(whole: np.ndarray) -> None:
    with pytest.raises(
        ImageError, match="is a fisheye picture, not an equirectangular panorama: stitch it, or remove it"
    ):
        check_full_panorama(fisheye(whole, (0.25, 0.75)))
    with pytest.raises(ImageError, match=r"or no panorama: .*, or remove it"):
        check_full_panorama(fisheye(whole, (0.5,)))


def test_real_panoramas_are_whole(data: Path) -> None:
    paths = [*(data / "panoramas").glob("*.jpg"), *(data / "city/amsterdam/panoramas").glob("*.jpg")]
    assert len(paths) >= 20
    for path in paths:
        with Image.open(path) as image:
            image.draft("RGB", (1024, 512))
            check_full_panorama(np.asarray(image.convert("RGB")))
