from __future__ import annotations

import cv2
import numpy as np
import pytest
from PIL import Image

from benchmarks.painter.facade import paint_facade as paint
from benchmarks.papers.tile_inpainting import diffuse_difference
from facade_core.core.errors import ImageError
from facade_core.core.labels import FacadeClass
from facade_core.core.types import Element
from facade_core.facade.photo_facade import _inpaint_over_rim
from facade_core.facade.texture.floor_inpainting import _forbid_foreign_rows, _roof_and_foot_rows
from facade_core.facade.texture.inpainting import inpaint
from facade_core.facade.texture.seams import find_min_error_path
from facade_core.facade.texture.source_costs import UNUSABLE_PRICE
from facade_core.facade.texture.window_completion import complete_windows


@pytest.fixture
def hole(facade) -> np.ndarray:
    mask = np.zeros(facade.labels.shape, bool)
    mask[75:125, 40:75] = True
    return mask


def spoiled(image: np.ndarray, mask: np.ndarray) -> np.ndarray:
    out = image.copy()
    out[mask] = (255, 0, 255)
    return out


def error(a: np.ndarray, b: np.ndarray, mask: np.ndarray) -> float:
    return float(np.abs(a[mask].astype(float) - b[mask]).mean())


def test_a_hidden_window_comes_back_and_known_pixels_stay(facade, hole):
    image = spoiled(facade.image, hole)
    filled = inpaint(image, hole, labels=facade.labels)
    np.testing.assert_array_equal(filled[~hole], image[~hole])
    telea = cv2.inpaint(image, hole.astype(np.uint8), 3, cv2.INPAINT_TELEA)
    assert error(filled, facade.image, hole) < 0.4 * error(telea, facade.image, hole)


def test_floors_needs_no_labels(facade, hole):
    filled = inpaint(spoiled(facade.image, hole), hole)
    assert error(filled, facade.image, hole) < 12.0


def test_what_is_in_the_hole_does_not_matter(facade, hole):
    first = inpaint(spoiled(facade.image, hole), hole)
    again = inpaint(facade.image, hole)
    np.testing.assert_array_equal(first, again)


def test_elements_decide_where_windows_go(facade):
    mask = np.zeros(facade.labels.shape, bool)
    mask[34:186, 36:108] = True  # both middle bays of all floors but the borders
    windows = [
        Element("window", 46 + 36 * b, 40 + 40 * f, 62 + 36 * b, 60 + 40 * f) for f in range(4) for b in range(2)
    ]
    filled = inpaint(spoiled(facade.image, mask), mask, labels=facade.labels, elements=windows)
    shown = np.zeros_like(mask)
    for e in windows:
        shown[int(e.y0) + 2 : int(e.y1) - 2, int(e.x0) + 2 : int(e.x1) - 2] = True
    dark = filled.mean(2) < 130
    assert dark[shown].mean() > 0.8


def test_an_unlikely_door_is_not_drawn(facade, hole):
    image = spoiled(facade.image, hole)
    rows, columns = np.nonzero(hole)
    box = columns.min() + 2, rows.min() + 2, columns.max() - 2, rows.max() - 2
    doors = [Element("door", *map(float, box), confidence) for confidence in (0.1, 0.9)]
    drawn = [inpaint(image, hole, labels=facade.labels, elements=e) for e in ([], doors[:1], doors[1:])]
    assert (drawn[0] == drawn[1]).all()
    assert (drawn[0] != drawn[2]).any()


def test_degenerate_masks(facade):
    none = np.zeros(facade.labels.shape, bool)
    np.testing.assert_array_equal(inpaint(facade.image, none), facade.image)
    with pytest.raises(ImageError, match="whole image"):
        inpaint(facade.image, ~none)
    frame = ~none
    frame[60:120, 30:100] = False
    for labels in (None, facade.labels):
        filled = inpaint(facade.image, frame, labels=labels)
        np.testing.assert_array_equal(filled[~frame], facade.image[~frame])
    with pytest.raises(ImageError, match="pass bool"):
        inpaint(facade.image, none.astype(np.uint8))


def test_without_repetition_it_still_fills():
    rng = np.random.default_rng(0)
    image = rng.integers(0, 255, (90, 120, 3), np.uint8)
    mask = np.zeros((90, 120), bool)
    mask[30:60, 40:70] = True
    filled = inpaint(spoiled(image, mask), mask)
    assert not (filled[mask] == (255, 0, 255)).all(1).any()
    assert filled[mask].std() > 40  # noise is continued by a patch, not smeared


def test_a_hole_that_touches_all_borders(facade):
    mask = np.zeros(facade.labels.shape, bool)
    mask[100:130], mask[:, 60:90] = True, True
    filled = inpaint(spoiled(facade.image, mask), mask, labels=facade.labels)
    np.testing.assert_array_equal(filled[~mask], facade.image[~mask])
    assert not (filled[mask] == (255, 0, 255)).all(1).any()


def test_what_is_visible_may_be_finer_than_the_working_blocks():
    rng = np.random.default_rng(0)
    image = np.tile(rng.integers(0, 255, (40, 40, 3), np.uint8), (12, 14, 1))
    mask = np.indices(image.shape[:2]).sum(0) % 2 == 0
    filled = inpaint(spoiled(image, mask), mask)
    assert not (filled[mask] == (255, 0, 255)).all(1).any()


def test_a_layout_does_not_wall_up_what_it_does_not_know(facade):
    mask = np.zeros(facade.labels.shape, bool)
    mask[-45:, 60:100] = True  # part of the shop
    window = [Element("window", 10, 40, 26, 60)]
    filled = inpaint(spoiled(facade.image, mask), mask, labels=facade.labels, elements=window)
    shop = mask & (facade.labels == FacadeClass.SHOP)
    assert error(filled, facade.image, shop) < 20.0


def test_where_too_little_is_seen_for_a_repetition_the_rest_is_diffused(facade):
    seen = np.random.default_rng(0).random(facade.labels.shape) < 0.065
    filled = inpaint(spoiled(facade.image, ~seen), ~seen)
    np.testing.assert_array_equal(filled[seen], facade.image[seen])
    assert not (filled == (255, 0, 255)).all(axis=2).any()
    assert error(filled, facade.image, ~seen) < 40


def test_the_least_path_bends_to_where_pictures_agree():
    error = np.ones((12, 7))
    error[:6, 5], error[6:, 3], error[6, 4] = 0.0, 0.0, 0.0
    path = find_min_error_path(error)
    np.testing.assert_array_equal(path[:5], 5)
    np.testing.assert_array_equal(path[7:], 3)
    assert np.abs(np.diff(path)).max() == 1


def test_levels_reproduce_a_constant_difference():
    weight = np.zeros((60, 80), np.float32)
    weight[:4] = 1.0
    offset = diffuse_difference(np.full((60, 80, 3), 20.0, np.float32), weight)
    np.testing.assert_allclose(offset, 20.0, rtol=1e-3)


def test_a_window_hidden_on_a_real_facade(data):
    folder = data / "facades" / "ecp"
    image = np.array(Image.open(folder / "images" / "monge_55.jpg").convert("RGB"))
    labels = np.array(Image.open(folder / "labels" / "monge_55.png"))
    labels = np.where(labels == 7, FacadeClass.ROOF, labels).astype(np.uint8)
    mask = np.zeros(labels.shape, bool)
    mask[150:290, 110:190] = True
    filled = inpaint(spoiled(image, mask), mask, labels=np.where(mask, 0, labels).astype(np.uint8))
    telea = cv2.inpaint(spoiled(image, mask), mask.astype(np.uint8), 3, cv2.INPAINT_TELEA)
    assert error(filled, image, mask) < error(telea, image, mask)
    window = mask & (labels == FacadeClass.WINDOW)
    wall = mask & (labels == 0)
    contrast = filled[wall].mean() - filled[window].mean()
    assert contrast > 0.5 * (image[wall].mean() - image[window].mean())


def test_what_a_hole_was_painted_with_does_not_show(facade):
    mask = np.zeros(facade.labels.shape, bool)
    mask[60:140, 40:130] = True
    one, other = (
        inpaint(np.where(mask[..., None], np.uint8(paint), facade.image), mask, labels=facade.labels)
        for paint in (0, 255)
    )
    np.testing.assert_array_equal(one, other)


def test_nor_is_a_repetition_read_from_it():
    small = paint((10.0, 10.0), floors=3, columns=3, style="brick", metres_per_pixel=0.1, seed=4)
    mask = np.zeros(small.labels.shape, bool)
    mask[40:60, 10:30] = True
    one, other = (
        inpaint(np.where(mask[..., None], np.uint8(colour), small.image), mask, labels=small.labels)
        for colour in ((255, 0, 255), (0, 255, 0))
    )
    np.testing.assert_array_equal(one, other)


def test_labels_that_are_no_class_are_refused(facade):
    mask = np.zeros(facade.labels.shape, bool)
    mask[60:100, 40:80] = True
    strange = facade.labels.copy()
    strange[:5, :5] = 7
    with pytest.raises(ImageError, match="id 7 is no class"):
        inpaint(facade.image, mask, labels=strange)


def test_a_picture_on_which_nothing_can_repeat_is_filled_from_around():
    image = np.full((9, 120, 3), 90, np.uint8)
    image[:, 60:] = 160
    mask = np.zeros((9, 120), bool)
    mask[2:, 20:40], mask[2:, 80:100] = True, True
    filled = inpaint(spoiled(image, mask), mask)
    assert np.abs(filled.astype(int) - image).max() <= 40
    assert np.abs(filled.astype(int) - image).mean() < 3


def test_a_window_that_a_hole_cuts_is_of_one_piece():
    rng = np.random.default_rng(1)
    image = np.full((170, 330, 3), 180, np.uint8)
    windows = []
    for y in (20, 70, 120):
        for x in range(20, 300, 50):
            image[y : y + 30, x : x + 24] = rng.integers(40, 90, 3)
            image[y : y + 30, x + 10 + int(rng.integers(5)) : x + 18] = 240  # a bar, wherever it is
            windows.append(Element("window", x, y, x + 24, y + 30))
    mask = np.zeros(image.shape[:2], bool)
    mask[60:110, 110:160] = True
    made = image.copy()
    made[70:85, 120:144] = image[20:35, 20:44]  # the upper half of one window, the lower of another
    made[85:100, 120:144] = image[135:150, 220:244]
    shown = complete_windows(made, mask, windows)
    np.testing.assert_array_equal(shown[~mask], image[~mask])
    own = shown[72:98, 122:142].astype(int)
    apart = [
        np.abs(own - image[int(e.y0) + 2 : int(e.y1) - 2, int(e.x0) + 2 : int(e.x1) - 2]).max()
        for e in windows
        if (e.x0, e.y0) != (120, 70)
    ]
    assert min(apart) <= 2
    np.testing.assert_array_equal(complete_windows(made, mask, []), made)


def test_nothing_made_is_darker_than_what_is_seen(facade, hole):
    seen = np.maximum(facade.image, 40)
    filled = inpaint(spoiled(seen, hole), hole, labels=facade.labels)
    assert (filled.reshape(-1, 3).min(axis=0) >= seen[~hole].min(axis=0)).all()


def test_the_ground_floor_has_no_source_on_the_roof():
    labels = np.zeros((100, 40), np.uint8)
    labels[:20], labels[14:26, 5:30] = FacadeClass.ROOF, FacadeClass.ROOF  # a dormer's foot reaches lower
    known = np.ones((100, 40), bool)
    known[85:, :30] = False
    roof, foot = _roof_and_foot_rows(labels, known)
    assert (roof.sum(), foot.sum()) == (26, 20)
    hidden = np.array([[90, 2], [90, 25], [84, 2]])
    translations = np.array([[-70, 0, 0], [-40, 0, 0], [1, 10, 0]])
    price = np.array([[1.0, 1.0, 1.0], [2.0, 2.0, 2.0], [UNUSABLE_PRICE, 3.0, 3.0]], np.float32)
    _forbid_foreign_rows(price, hidden, translations, roof, foot)
    is_usable = price < UNUSABLE_PRICE
    assert is_usable[:, 0].tolist() == [False, True, False], "of a floor, where nothing beside it is seen"
    assert is_usable[:, 1].tolist() == [False, False, True], "of the row beside it"
    assert is_usable[:, 2].tolist() == [False, False, True]
    price[:] = 1.0
    _forbid_foreign_rows(price, np.array([[50, 2]] * 3), translations, roof, foot)
    assert (price == 1.0).all(), "other floors are free"


def test_the_rim_of_a_hole_fades_into_the_photo():
    image = np.full((200, 200, 3), 100, np.uint8)
    hidden = np.zeros((200, 200), bool)
    hidden[120:, :100] = True
    image[hidden] = 255
    image[118:120, :100] = 180  # blurred occluder that its mask misses
    result, changed = _inpaint_over_rim(image, hidden, np.zeros((200, 200), np.uint8), [])
    filled = result.astype(int)
    assert np.abs(filled[hidden] - 100).max() < 20
    assert np.abs(filled[119, 20:80] - 100).max() < 45, "next to the hole it is mostly filling"
    np.testing.assert_array_equal(filled[~changed], image[~changed])
    assert changed.mean() < hidden.mean() + 0.02
