"""Each part of an exemplar's judgement falls with the defect that it is for, and with no other."""

from __future__ import annotations

from dataclasses import asdict

import cv2
import numpy as np
import pytest

from benchmarks.painter.facade import paint_facade
from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.facade.exemplar_quality import ExemplarQuality, judge_exemplar
from facade_core.parsing.floor_structure import find_floors_and_bays

MPP = 0.05
PAINTED = paint_facade((16.0, 14.0), floors=5, columns=5, style="haussmann", metres_per_pixel=MPP, seed=2)
FOUND = find_floors_and_bays(PAINTED.labels)
assert FOUND is not None
NOTHING = np.zeros(PAINTED.labels.shape, bool)


def judge(
    image: UInt8Array = PAINTED.image,
    labels: UInt8Array = PAINTED.labels,
    hidden: BoolArray = NOTHING,
    shaded: float = 0.0,
) -> ExemplarQuality:
    return judge_exemplar(image, labels, hidden, MPP, shaded)


def hide(rows: slice) -> BoolArray:
    hidden = NOTHING.copy()
    hidden[rows, : hidden.shape[1] // 2] = True
    return hidden


def grow_tree() -> UInt8Array:
    image = PAINTED.image.copy()
    image[40:240, 60:160] = (40, 120, 30)
    return image


def lean(array: UInt8Array) -> UInt8Array:
    shear = np.array([[1.0, 0.06, 0.0], [0.0, 1.0, 0.0]])
    size = array.shape[1::-1]
    return np.asarray(cv2.warpAffine(array, shear, size, flags=cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE))


def lose_windows() -> UInt8Array:
    labels = PAINTED.labels.copy()
    (top, bottom), (left, right) = FOUND.floors[1], FOUND.bays[1]
    labels[top - 2 : bottom + 2, left - 2 : right + 2] = FacadeClass.WALL
    return labels


def darken_foot() -> UInt8Array:
    image, half = PAINTED.image.copy(), PAINTED.image.shape[1] // 2
    image[FOUND.ground_top :, :half] //= 5
    return image


DEFECTS = {
    "sharpness": judge(image=np.asarray(cv2.GaussianBlur(PAINTED.image, (0, 0), 3.0), np.uint8)),
    "upper": judge(hidden=hide(slice(0, FOUND.ground_top))),
    "foot": judge(hidden=hide(slice(FOUND.ground_top, None))),
    "clean": judge(image=grow_tree()),
    "whole": judge(labels=lose_windows()),
    "light": judge(shaded=0.4),
    "straight": judge(image=lean(PAINTED.image), labels=lean(PAINTED.labels)),
}


def test_a_ground_floor_in_deep_shadow_is_as_good_as_hidden() -> None:
    assert judge(image=darken_foot()).foot < judge().foot - 0.3


def test_a_burnt_out_wall_is_in_bad_light() -> None:
    image = PAINTED.image.copy()
    image[: len(image) // 4] = 255
    assert judge(image=image).light < judge().light - 0.3


@pytest.mark.parametrize("part", DEFECTS)
def test_a_defect_lowers_its_part_and_the_score(part: str) -> None:
    good, bad = judge(), DEFECTS[part]
    assert min(asdict(good).values()) > 0.7, good
    assert getattr(bad, part) < getattr(good, part) - 0.03
    assert bad.score < good.score
    others = [name for name in asdict(good) if name not in (part, "sharpness")]
    if part != "straight":  # leaning windows miss their places
        assert all(abs(getattr(bad, name) - getattr(good, name)) < 0.03 for name in others)
