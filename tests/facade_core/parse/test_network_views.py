from dataclasses import dataclass

import numpy as np
import pytest

from facade_core.core.labels import UNKNOWN
from training.parser.views import (
    ANY_CLASS,
    VIEW_SIDE,
    OccluderCutout,
    extract_occluder_cutouts,
    occluder_loss_weights,
    sample_view,
)


@dataclass(frozen=True)
class Photo:
    image: np.ndarray
    possible: np.ndarray
    occluder: np.ndarray
    outside: np.ndarray


def gradient(height, width):
    """A photo whose red and green tell the place, and whose upper half may be class 0, the lower one class 1 or 2."""
    y, x = np.mgrid[0:height, 0:width]
    image = np.dstack([y * 255 // max(1, height - 1), x * 255 // max(1, width - 1), np.full_like(y, 128)])
    possible = np.where(y < height // 2, 0b1, 0b110).astype(np.uint8)
    # Outside is what may be class 1 or 2, so that it can be followed with the class.
    return Photo(
        image.astype(np.uint8), possible, np.zeros((height, width), np.uint8), (possible != 1).astype(np.uint8)
    )


@pytest.mark.parametrize("shape", [(541, 328), (1024, 1024), (60, 2000), (7, 3)])
def test_views_have_one_size_and_keep_the_values(shape):
    for seed in range(12):
        shown = sample_view(gradient(*shape), [], np.random.default_rng(seed))
        assert shown.image.shape == (VIEW_SIDE, VIEW_SIDE, 3)
        assert shown.possible.shape == shown.occluder.shape == (VIEW_SIDE, VIEW_SIDE)
        assert shown.place.shape == (2, VIEW_SIDE // 8, VIEW_SIDE // 8)
        assert set(np.unique(shown.possible)) <= {0b1, 0b110, ANY_CLASS}
        assert ((shown.possible == ANY_CLASS) == (shown.occluder == UNKNOWN)).all()
        assert ((shown.possible == 0b110) == (shown.outside == 1)).all()
        assert ((shown.possible == ANY_CLASS) == (shown.outside == UNKNOWN)).all()
        assert (shown.possible != ANY_CLASS).any()


def test_labels_follow_the_place_in_the_photo():
    compared = 0
    for seed in range(60):
        shown = sample_view(gradient(900, 700), [], np.random.default_rng(seed))
        across, down = shown.place
        assert (np.diff(across, axis=1) > 0).all()  # also in a mirrored view, which is one of a mirrored photo
        if down[0, 0] < -0.9:
            continue  # from the top of the photo, or standing for a whole one
        clear = (np.abs(down) > 0.1) & (down < 1) & (np.abs(across) < 1)
        assert (((shown.possible[4::8, 4::8] == 0b1) == (down < 0))[clear]).mean() > 0.98
        compared += 1
    assert compared > 10


def test_equal_seeds_give_equal_views():
    photo, piece = gradient(300, 200), OccluderCutout(np.full((40, 30, 4), 255, np.uint8), 0.2)
    first, second = (sample_view(photo, [[], [piece]], np.random.default_rng(3)) for _ in range(2))
    assert (first.image == second.image).all()
    assert (first.place == second.place).all()


def test_a_cut_out_hides_the_image_but_not_the_class():
    photo = gradient(320, 320)
    piece = OccluderCutout(np.dstack([np.full((50, 50, 3), 7, np.uint8), np.full((50, 50), 255, np.uint8)]), 0.2)
    hidden = [sample_view(photo, [[piece]], np.random.default_rng(seed)) for seed in range(40)]
    hidden = [shown for shown in hidden if (shown.occluder == 1).any()]
    assert len(hidden) > 4
    for shown in hidden:
        assert set(np.unique(shown.possible[shown.occluder == 1])) <= {0b1, 0b110, ANY_CLASS}
        assert (shown.occluder == 1).mean() < 0.95
    assert any((shown.possible[shown.occluder == 1] != ANY_CLASS).any() for shown in hidden)


def test_cut_outs_are_the_things_in_front():
    photo = gradient(200, 200)
    photo.occluder[20:60, 30:50] = 1
    photo.occluder[100:101, 100:102] = 1  # too small
    photo.occluder[150:160, 150:180] = UNKNOWN
    photo.occluder[100:120, 40:70] = 1
    (cutout,), (other,) = extract_occluder_cutouts([photo])
    assert other.image.shape == (20, 30, 4), "a car is not upright"
    assert cutout.height_share == 40 / 200
    assert cutout.image.shape == (40, 20, 4)
    assert (cutout.image[..., 3] == 255).all()
    assert (cutout.image[..., :3] == photo.image[20:60, 30:50]).all()


def test_things_mostly_stand_at_the_photos_foot_as_high_as_in_their_own():
    photo = gradient(320, 320)
    piece = OccluderCutout(np.full((20, 20, 4), 255, np.uint8), 0.1)
    heights = []
    for seed in range(300):
        shown = sample_view(photo, [[piece]], np.random.default_rng(seed))
        known = shown.possible != ANY_CLASS
        foot = np.flatnonzero(known.any(1))[-1]
        hidden = np.flatnonzero((shown.occluder == 1).any(1))
        if hidden.size and shown.place[1, -1, 0] >= 0.9 and hidden[0] > 0.7 * foot:
            scale = (shown.place[1, 1, 0] - shown.place[1, 0, 0]) / 16
            heights.append((foot - hidden[0]) * scale)
    assert len(heights) > 40
    assert 0.05 < np.median(heights) < 0.2


def test_a_small_thing_counts_nearly_as_much_as_a_large_one():
    occluder = np.zeros((320, 320), np.uint8)
    occluder[:, :40] = UNKNOWN
    occluder[200:250, 60:80] = 1
    occluder[100:300, 120:320] = 1
    occluder[5, 300] = 1
    count = occluder_loss_weights(occluder)
    assert (count[occluder == UNKNOWN] == 0).all()
    assert (count[occluder == 0] == 1).all()
    assert count[5, 300] == 4
    assert np.unique(count[200:250, 60:80]) == np.float32(np.sqrt(0.06 * 320**2 / 1000))
    assert (count[100:300, 120:320] == 1).all()
    assert (occluder_loss_weights(np.full((9, 9), UNKNOWN, np.uint8)) == 0).all()
