import itertools

import numpy as np
import pytest

from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.imagery.rectify import building_crop, crop
from facade_core.imagery.rectify.building_crop import crop_to_facade
from facade_core.imagery.rectify.crop import find_facade_box, wall_surroundings_mask
from facade_core.imagery.rectify.settings import CROP
from facade_core.parsing.segmenter import Surroundings


def patch_surroundings(monkeypatch: pytest.MonkeyPatch, outside: BoolArray, labels: UInt8Array) -> None:
    monkeypatch.setattr(
        building_crop, "segment_surroundings", lambda image, hidden, model: Surroundings(outside, labels)
    )


def test_the_box_is_the_best_of_all():
    rng = np.random.default_rng(0)
    for _ in range(30):
        outside, hidden = rng.random((7, 6)) < 0.4, rng.random((7, 6)) < 0.2
        value = np.where(hidden, 0, np.where(outside, -1, 1))
        boxes = itertools.product(itertools.combinations(range(8), 2), itertools.combinations(range(7), 2))
        best = max(value[slice(*rows), slice(*columns)].sum() for rows, columns in boxes)
        box = find_facade_box(outside, hidden)
        if box is not None:
            x0, y0, x1, y1 = box
            assert value[y0:y1, x0:x1].sum() == best


@pytest.mark.parametrize("box", [(30, 0, 70, 100), (0, 35, 100, 75), (55, 40, 100, 100), (0, 0, 100, 100)])
def test_a_facade_may_be_narrower_or_lower_than_half_its_picture(box):
    outside = np.ones((100, 100), bool)
    x0, y0, x1, y1 = box
    outside[y0:y1, x0:x1] = False
    assert find_facade_box(outside, np.zeros_like(outside)) == box


def test_a_box_leaves_out_sky_street_and_neighbours():
    outside = np.zeros((100, 80), bool)
    outside[:12], outside[90:] = True, True
    outside[20:, :9] = True  # a lower neighbour
    outside[12:20, 30:34] = True  # beside a dormer
    assert find_facade_box(outside, np.zeros_like(outside)) == (9, 12, 80, 90)


def test_in_large_pictures_sides_are_found_within_a_part():
    outside = np.zeros((2000, 3100), bool)
    outside[:301] = outside[1802:] = True
    outside[:, :205] = True
    box = find_facade_box(outside, np.zeros_like(outside))
    assert np.abs(np.array(box) - (205, 301, 3100, 1802)).max() <= 3100 / CROP.grid_cells


def test_noise_at_the_border_and_panes_within_do_not_decide():
    rng = np.random.default_rng(0)
    outside = np.zeros((120, 90), bool)
    outside[:20] = True
    noise = outside ^ (rng.random(outside.shape) < 0.1)
    noise[60:70, 30:50] = True
    assert find_facade_box(noise, np.zeros_like(noise)) == (0, 20, 90, 120)


def test_what_is_hidden_is_neither_cut_nor_kept_for_its_own_sake():
    outside, hidden = np.zeros((2, 60, 50), bool)
    hidden[40:] = True
    assert find_facade_box(outside, hidden) == (0, 0, 50, 60)
    outside[:40, :10] = True
    assert find_facade_box(outside, hidden) == (10, 0, 50, 60)


def test_what_is_left_outside_at_the_border_is_told(monkeypatch: pytest.MonkeyPatch):
    outside = np.zeros((60, 50), bool)
    outside[:10] = True
    outside[10:20, :5] = True  # beside a gable
    outside[30:34, 20:24] = True  # a pane with sky in it
    patch_surroundings(monkeypatch, outside, np.zeros_like(outside, np.uint8))
    image, hidden = np.random.default_rng(0).integers(0, 256, (60, 50, 3), dtype=np.uint8), np.zeros((60, 50), bool)
    hidden[50:55, 40:] = True
    found = crop_to_facade(image, hidden)
    assert found.has_facade
    assert found.box == (0, 10, 50, 60)
    assert (found.image == image[10:]).all()
    assert (found.hidden == hidden[10:]).all()
    expected = np.zeros((50, 50), bool)
    expected[:10, :5] = True
    assert (found.outside == expected).all()


def test_a_picture_of_which_little_is_a_facade_stays_whole(monkeypatch: pytest.MonkeyPatch):
    outside = np.ones((60, 50), bool)
    nothing = np.zeros_like(outside)
    assert find_facade_box(outside, nothing) is None
    outside[20:30, 10:20] = False
    assert find_facade_box(outside, nothing) is None
    patch_surroundings(monkeypatch, outside, np.zeros_like(outside, np.uint8))
    image = np.zeros((60, 50, 3), np.uint8)
    found = crop_to_facade(image, nothing)
    assert found.box == (0, 0, 50, 60)
    assert not found.has_facade
    assert not found.outside.any()
    assert crop_to_facade(image, ~nothing).box == (0, 0, 50, 60), "nothing of it is looked at"


def test_sky_beyond_the_skyline_is_masked(monkeypatch: pytest.MonkeyPatch):
    """A wall that is taken for a neighbour as a whole under an overcast sky, which is on its right too."""
    image = np.full((200, 150, 3), 110, np.uint8)
    image[:30], image[:, 135:] = 245, 245
    outside, hidden = np.zeros((2, 200, 150), bool)
    outside[:, :60] = True
    monkeypatch.setattr(crop, "facade_surroundings_mask", lambda image, hidden, model: outside)
    found = wall_surroundings_mask(image, hidden)
    assert found[:30, 60:130].all()
    assert found[40:, 135:].all()
    assert not found[40:, :125].any(), "without a step it may be the wall"
    image[:] = 245
    assert not wall_surroundings_mask(image, hidden).any(), "a white wall"
    image[:30], image[30:] = (120, 160, 220), 200
    outside[:] = False
    assert wall_surroundings_mask(image, hidden)[:30].all(), "a clear sky above a pale wall"


def test_a_strip_of_clear_sky_beside_a_wall_is_cut_with_what_is_beyond_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """At the left, behind a dark edge of another building; panes at the right reflect the sky and stay."""
    monkeypatch.setattr(crop, "facade_surroundings_mask", lambda image, hidden, model: np.zeros_like(hidden))
    image = np.full((300, 330, 3), 120, np.uint8)
    image[:, :6] = 70
    image[4:110, 6:16] = (165, 203, 232)
    for top in range(12, 280, 40):
        image[top : top + 25, 304:322] = (165, 203, 232)
    hidden = np.zeros(image.shape[:2], bool)
    found = wall_surroundings_mask(image, hidden)
    assert found[:, :16].all(), "the wall's edge is upright"
    assert not found[:, 20:].any()
    mirrored = wall_surroundings_mask(np.ascontiguousarray(image[:, ::-1]), hidden)
    assert (mirrored[:, ::-1] == found).all()
    for row in range(4, 110):  # the roof of a lower house beside the wall
        image[row, 16 : 16 + (110 - row) // 3] = (165, 203, 232)
    sloping = wall_surroundings_mask(image, hidden)
    assert sloping[4:100, :16].all()
    assert not sloping[120:].any()
    image[:, 6:60] = 120
    assert not wall_surroundings_mask(image, hidden).any(), "panes alone"


def test_a_wall_ends_at_an_upright_edge_in_all_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    """A light neighbour, which the parser finds in half of the rows; a bare wall up to its windows is none."""
    image = np.full((240, 200, 3), 90, np.uint8)
    image[:, :24] = 160
    outside, hidden = np.zeros((2, 240, 200), bool)
    outside[:, :24] = True
    outside[60:160, 8:24] = False  # a ledge of the neighbour
    hidden[200:, :20] = True  # a car before it
    monkeypatch.setattr(crop, "facade_surroundings_mask", lambda image, hidden, model: outside)
    found = wall_surroundings_mask(image, hidden)
    assert (found | hidden)[:, :24].all()
    assert not found[:, 32:].any()
    mirrored_outside = np.ascontiguousarray(outside[:, ::-1])
    monkeypatch.setattr(crop, "facade_surroundings_mask", lambda image, hidden, model: mirrored_outside)
    mirrored = wall_surroundings_mask(np.ascontiguousarray(image[:, ::-1]), np.ascontiguousarray(hidden[:, ::-1]))
    assert (mirrored[:, ::-1] == found).all()
    outside[60:160, :40] = True  # between windows the bare wall goes on
    monkeypatch.setattr(crop, "facade_surroundings_mask", lambda image, hidden, model: outside)
    assert not wall_surroundings_mask(image, hidden)[70:150].any()


@pytest.mark.parametrize("size", [(11, 200), (200, 11), (3, 5)])
def test_walls_too_small_for_a_step_keep_their_surroundings(
    monkeypatch: pytest.MonkeyPatch, size: tuple[int, int]
) -> None:
    hidden = np.zeros(size, bool)
    monkeypatch.setattr(crop, "facade_surroundings_mask", lambda image, hidden, model: ~hidden)
    assert wall_surroundings_mask(np.full((*size, 3), 90, np.uint8), hidden).shape == size


def test_a_street_below_the_foot_is_told_and_bare_walls_stay(monkeypatch: pytest.MonkeyPatch):
    """Twelve rows of street, on which a car stands; a third of the wall is bare and taken for a neighbour's."""
    outside, hidden = np.zeros((2, 100, 90), bool)
    outside[88:] = True
    outside[:, :30] = True
    hidden[80:94, 60:75] = True
    outside[80:94, 60:75] = False
    outside[20:30, 40:50] = True  # a pane
    monkeypatch.setattr(crop, "facade_surroundings_mask", lambda image, hidden, model: outside)
    image = np.zeros((100, 90, 3), np.uint8)
    street = np.zeros_like(outside)
    street[88:, 30:] = True
    assert (wall_surroundings_mask(image, hidden) == (street & ~hidden)).all()
    # a plinth that is taken for street here and there is none
    outside[:] = False
    outside[96:, 10:30] = True
    assert not wall_surroundings_mask(image, hidden).any()
    outside[:5] = True  # sky; a car before every other column is no street
    hidden[90:, 30:80] = True
    assert not wall_surroundings_mask(image, hidden).any()
    assert not wall_surroundings_mask(image, np.ones_like(hidden)).any()


def test_a_gate_that_looks_like_street_is_part_of_the_facade() -> None:
    outside = np.zeros((100, 80), bool)
    outside[92:, 10:30] = outside[50:, 50:65] = True
    kept = crop.crop_to_box(np.zeros((100, 80, 3), np.uint8), np.zeros_like(outside), outside, (0, 0, 80, 100)).outside
    assert kept[92:, 10:30].all()
    assert not kept[:, 50:65].any()
