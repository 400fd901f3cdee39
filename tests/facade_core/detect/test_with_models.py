"""Faces, plates and text on pictures, where `make detect-setup` has been run."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from PIL import Image, ImageDraw, ImageFont
from skimage import data

from benchmarks.faces_and_plates import painted_plate
from facade_core.imagery.detect.detection import detect_faces_plates_text
from facade_core.imagery.detect.faces import box_ious, find_faces
from facade_core.imagery.detect.models import INSTALL_REMEDY, missing_packages
from facade_core.imagery.detect.text import find_text_lines

pytestmark = pytest.mark.skipif(
    bool(missing_packages()), reason=f"{', '.join(missing_packages())} not installed; {INSTALL_REMEDY}"
)


@pytest.mark.parametrize("height", [16, 60])
def test_a_face_is_found_where_it_is(height: int) -> None:
    image, box = data.astronaut()[:300, 60:400], (118, 62, 208, 178)
    scale = height / (box[3] - box[1])
    small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    wall = np.full((200, 300, 3), 180, np.uint8)
    wall[40 : 40 + len(small), 90 : 90 + small.shape[1]] = small[:160]
    found, scores = find_faces(wall)
    assert len(found) == 1
    assert scores[0] > 0.5
    true = np.array(box) * scale + [90, 40, 90, 40]
    assert box_ious(true, found)[0] > 0.5
    again, _ = find_faces(wall)
    assert (again == found).all()


def test_nothing_is_found_on_a_plain_wall() -> None:
    wall = np.full((200, 300, 3), 180, np.uint8)
    assert not detect_faces_plates_text(wall).has_private_boxes()
    assert not find_text_lines(wall)


def test_a_sign_is_read_and_a_plate_is_hidden() -> None:
    picture = Image.new("RGB", (500, 400), (200, 190, 170))
    draw = ImageDraw.Draw(picture)
    draw.text((250, 220), "GREEN SPRING", (20, 40, 30), ImageFont.load_default(36), "mm")
    plate = Image.fromarray(painted_plate(np.random.default_rng(1))).resize((94, 20), Image.Resampling.LANCZOS)
    picture.paste(plate, (300, 350))
    seen = detect_faces_plates_text(np.asarray(picture))
    signs = [line.text.replace(" ", "") for line in seen.lines if line.corners[0, 1] < 300]
    assert signs == ["GREENSPRING"], "blanks may be lost"
    assert len(seen.plates) in (1, 2), "one that both looks found has two boxes"
    hidden = seen.private_mask((400, 500))
    assert hidden[350:370, 300:394].mean() > 0.6, "of one that is read as two lines the digits, at least"
    assert not hidden[:300].any()
