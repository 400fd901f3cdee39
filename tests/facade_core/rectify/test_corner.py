"""Both facades of a corner in one photo: the larger and more frontal one is taken, up to the corner."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.painter.facade import paint_facade
from facade_core.imagery.rectify.photo import rectify

SIZE, FOCAL = (900, 1200), 1000.0
# Metres of the walls: from the corner to the left, to the right, and up.
LEFT, RIGHT, HIGH = 14.0, 9.0, 12.0


def photo_of_corner(yaw: float, right: float = RIGHT) -> tuple[np.ndarray, np.ndarray]:
    """A photo of a corner house and the corner's foot and top in it, (2, 2); yaw: degrees of the left wall."""
    turned = Rotation.from_euler("xy", [12, yaw], degrees=True).as_matrix()
    camera = np.array([[FOCAL, 0, SIZE[1] / 2], [0, FOCAL, SIZE[0] / 2], [0, 0, 1.0]])
    centre = np.array([0.0, -1.0, 19.0])

    def project(points: np.ndarray) -> np.ndarray:
        seen = (points @ turned.T + centre) @ camera.T
        return np.asarray(seen[:, :2] / seen[:, 2:])

    photo = np.full((*SIZE, 3), (150, 185, 225), np.uint8)
    for width, along, seed in ((LEFT, (-1.0, 0.0, 0.0), 3), (right, (0.0, 0.0, 1.0), 3)):
        if not width:
            continue
        columns = round(width / 3)
        painted = paint_facade(
            (HIGH, width), floors=4, columns=columns, style="haussmann", metres_per_pixel=0.03, seed=seed
        )
        image = painted.image
        far, near = np.array(along) * width, np.zeros(3)
        first, last = (far, near) if along[0] < 0 else (near, far)
        down = np.array([0, HIGH / 2, 0])
        target = project(np.array([first - down, last - down, last + down, first + down]))
        height, wide = image.shape[:2]
        source = np.float32([[0, 0], [wide, 0], [wide, height], [0, height]])
        warp = cv2.getPerspectiveTransform(source, target.astype(np.float32))
        cv2.warpPerspective(image, warp, SIZE[::-1], photo, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_TRANSPARENT)
    corner = project(np.array([[0, -HIGH / 2, 0], [0, HIGH / 2, 0]]))
    return np.clip(photo + np.random.default_rng(0).normal(0, 2, photo.shape), 0, 255).astype(np.uint8), corner


@pytest.mark.parametrize("yaw", [25.0, 35.0])
def test_the_other_facade_of_a_corner_is_left_out(yaw: float) -> None:
    photo, corner = photo_of_corner(yaw)
    found = rectify(photo)
    assert found.other_facade == "right"
    moved = np.column_stack([corner, np.ones(2)]) @ found.homography.T
    columns = moved[:, 0] / moved[:, 2]
    assert columns == pytest.approx(found.image.shape[1], abs=0.04 * found.image.shape[1])


def test_a_facade_alone_has_no_corner() -> None:
    photo, _ = photo_of_corner(20.0, right=0.0)
    assert rectify(photo).other_facade is None
