"""Black corners of rectified pictures are found, and nothing that is only dark."""

from __future__ import annotations

import io

import cv2
import numpy as np
import pytest
from PIL import Image

from facade_core.imagery.rectify.no_data import NO_DATA_RIM, no_data_mask
from facade_core.synth.facade import paint_facade
from facade_core.synth.styles import STYLES


def warped(lean: float) -> tuple[np.ndarray, np.ndarray]:
    """A painted facade as a rectification leaves it, sheared, as a JPEG; and what of it is no part of the picture."""
    image = paint_facade((10.0, 14.0), floors=3, columns=4, style=STYLES[0], metres_per_pixel=0.05, seed=3).image
    height, width = image.shape[:2]
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float32)
    moved = corners + np.array([[lean, 0], [0, lean], [0, -lean / 2], [lean / 3, 0]], np.float32)
    turn = cv2.getPerspectiveTransform(corners, moved)
    beside = (
        cv2.warpPerspective(np.ones((height, width), np.uint8), turn, (width, height), flags=cv2.INTER_NEAREST) == 0
    )
    file = io.BytesIO()
    Image.fromarray(cv2.warpPerspective(image, turn, (width, height))).save(file, "JPEG", quality=85)
    return np.asarray(Image.open(file)), beside


@pytest.mark.parametrize(("lean", "share"), [(12.0, 0.75), (30.0, 0.97), (60.0, 0.97)])
def test_what_a_warp_left_black_is_found(lean: float, share: float) -> None:
    image, beside = warped(lean)
    found = no_data_mask(image)
    assert found[beside].mean() > share
    reach = 2 * (NO_DATA_RIM + 3) + 1
    assert not found[cv2.dilate(beside.astype(np.uint8), np.ones((reach, reach), np.uint8)) == 0].any()


@pytest.mark.parametrize("style", STYLES)
def test_nothing_of_a_whole_picture_is_taken_for_a_corner(style: str) -> None:
    image = paint_facade((10.0, 14.0), floors=3, columns=4, style=style, metres_per_pixel=0.05, seed=4).image
    assert not no_data_mask(image).any()


def test_what_is_dark_at_the_border_is_kept() -> None:
    image = np.full((200, 300, 3), 150, np.uint8)
    image[120:, 100:160] = 4
    assert not no_data_mask(image).any()
    image[100:, 230:] = 4  # in a corner at the foot, and upright
    assert not no_data_mask(image).any()
    image[:60, :90] = 0  # in a corner above
    assert no_data_mask(image)[:60, :90].all()
    assert not no_data_mask(image)[100:].any()
    image[:, 280:] = 0  # along a whole side
    assert no_data_mask(image)[:, 280:].all()
    assert not no_data_mask(np.zeros_like(image)).any()
