"""Painted facades as exemplars: sound ones, and ones with a fault each."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from benchmarks.painter.facade import paint_facade
from facade_core.core.types import Element
from facade_core.facade.exemplar_admission import FacadePicture, assess_candidate
from facade_core.facade.vegetation import measure_tree_share


@pytest.fixture(scope="module")
def sound() -> FacadePicture:
    painted = paint_facade((13.0, 14.0), floors=4, columns=5, style="plaster", metres_per_pixel=0.03, seed=2)
    hidden = np.zeros(painted.labels.shape, bool)
    return FacadePicture(painted.image, painted.labels, hidden, painted.elements, 0.03)


def test_a_sound_facade_has_no_reason_against_it(sound: FacadePicture) -> None:
    found = assess_candidate(sound)
    assert found.reasons == ()
    assert found.quality.score > 0.3


def cover_part(picture: FacadePicture, part: slice) -> FacadePicture:
    hidden = picture.hidden.copy()
    hidden[part] = True
    return replace(picture, hidden=hidden)


def shear(picture: FacadePicture) -> FacadePicture:
    """The facade leans by 6 degrees."""
    height, width = picture.labels.shape
    lean = np.float32([[1, 0.1, -0.05 * height], [0, 1, 0]])
    image = cv2.warpAffine(picture.image, lean, (width, height), borderMode=cv2.BORDER_REPLICATE)
    labels = cv2.warpAffine(picture.labels, lean, (width, height), flags=cv2.INTER_NEAREST)
    return replace(picture, image=image, labels=labels)


def shade(picture: FacadePicture) -> FacadePicture:
    """The left two fifths of the facade are in a shadow."""
    image = picture.image.copy()
    image[:, : 2 * image.shape[1] // 5] //= 3
    return replace(picture, image=image)


def plant_tree(picture: FacadePicture) -> FacadePicture:
    """A tree of light and dark leaves stands before the lower half."""
    image = picture.image.copy()
    height, width = image.shape[:2]
    leaves = np.random.default_rng(4).choice([0.5, 1.6], (height // 12 + 1, width // 12 + 1))
    leaves = np.kron(leaves, np.ones((12, 12)))[:height, :width, None] * [50, 80, 30]
    crown = cv2.circle(np.zeros((height, width), np.uint8), (width // 2, 3 * height // 4), height // 6, 1, -1) > 0
    image[crown] = leaves[crown]
    return replace(picture, image=image)


def cut_foot(picture: FacadePicture) -> FacadePicture:
    """The picture ends in the middle of the second floor's windows from above."""
    rows = sorted({(each.y0, each.y1) for each in picture.windows()})
    floor = next(span for span in rows if span[0] > rows[0][1])
    end = round(sum(floor) / 2)
    elements = [each for each in picture.elements if each.y1 <= end]
    return replace(
        picture, image=picture.image[:end], labels=picture.labels[:end], hidden=picture.hidden[:end], elements=elements
    )


def shift_columns(windows: list[Element]) -> list[Element]:
    """Each column two fifths of a window lower than the one on its left."""
    columns = sorted({each.x0 for each in windows})
    down = {x0: 0.4 * place * windows[0].height for place, x0 in enumerate(columns)}
    return [replace(each, y0=each.y0 + down[each.x0], y1=each.y1 + down[each.x0]) for each in windows]


@pytest.mark.parametrize("beside", [False, True])
def test_green_shutters_are_no_trees(sound: FacadePicture, beside: bool) -> None:
    image = sound.image.copy()
    image[:] = (150, 80, 60)
    slats = np.where(np.arange(len(image)) // 2 % 2, 1.5, 0.6)[:, None, None] * [45, 85, 40]
    for window in sound.windows():
        shift = round(window.width) + 3 if beside else 0
        rows, columns = (
            slice(round(window.y0), round(window.y1)),
            slice(round(window.x0) + shift, round(window.x1) + shift),
        )
        image[rows, columns] = np.broadcast_to(slats, image.shape)[rows, columns]
    assert measure_tree_share(image, sound.labels, sound.hidden) == 0
    assert measure_tree_share(plant_tree(sound).image, sound.labels, sound.hidden) > 0.02


def test_each_fault_is_named(sound: FacadePicture) -> None:
    rows = len(sound.hidden)
    foot = slice(2 * rows // 3, rows)
    dark = sound.image.copy()
    dark[foot] //= 8
    windows = [each for each in sound.elements if each.label == "window"]
    cases = {
        "blurred": replace(sound, image=cv2.GaussianBlur(sound.image, (0, 0), 9)),
        "of its foot is hidden": cover_part(sound, foot),
        "pixels per metre": replace(sound, metres_per_pixel=0.12),
        "its columns of windows lean": shear(sound),
        "a shadow covers": shade(sound),
        "trees cover": plant_tree(sound),
        "its lowest floor is cut off": cut_foot(sound),
        "its foot is too dark": replace(sound, image=dark),
        "in no rows": replace(sound, elements=shift_columns(windows)),
        "uncertain": replace(sound, elements=[replace(each, confidence=0.4) for each in windows]),
        "columns of windows": replace(sound, elements=windows[:1]),
        "floors are seen": replace(sound, labels=np.zeros_like(sound.labels)),
    }
    for reason, picture in cases.items():
        found = assess_candidate(picture)
        assert any(reason in each for each in found.reasons), (reason, found)
