import itertools

import numpy as np
import pytest

from facade_core.rectify import cut
from facade_core.rectify.cut import cut_to_facade, facade_box


def greatest(values):
    """The plain reference of a run: every start and stop."""
    runs = itertools.combinations(range(len(values) + 1), 2)
    return max(runs, key=lambda run: (values[slice(*run)].sum(), run[1] - run[0], -run[0]))


def test_the_greatest_run_is_that_of_all():
    rng = np.random.default_rng(0)
    for _ in range(200):
        values = rng.integers(-3, 4, rng.integers(1, 12))
        if (values > 0).any():
            assert cut._greatest_run(values) == greatest(values)


def test_a_box_leaves_out_sky_street_and_neighbours():
    outside = np.zeros((100, 80), bool)
    outside[:12], outside[90:] = True, True
    outside[20:, :9] = True  # a lower neighbour
    outside[12:20, 30:34] = True  # beside a dormer
    assert facade_box(outside, np.zeros_like(outside)) == (9, 12, 80, 90)


def test_noise_at_the_border_and_panes_within_do_not_decide():
    rng = np.random.default_rng(0)
    outside = np.zeros((120, 90), bool)
    outside[:20] = True
    noise = outside ^ (rng.random(outside.shape) < 0.1)
    noise[60:70, 30:50] = True
    assert facade_box(noise, np.zeros_like(noise)) == (0, 20, 90, 120)


def test_what_is_hidden_is_neither_cut_nor_kept_for_its_own_sake():
    outside, hidden = np.zeros((2, 60, 50), bool)
    hidden[40:] = True
    assert facade_box(outside, hidden) == (0, 0, 50, 60)
    outside[:40, :10] = True
    assert facade_box(outside, hidden) == (10, 0, 50, 60)


def test_a_picture_of_which_little_is_a_facade_stays_whole():
    outside = np.ones((60, 50), bool)
    outside[20:30, 10:20] = False
    nothing = np.zeros_like(outside)
    assert facade_box(outside, nothing) == (0, 0, 50, 60)
    assert facade_box(~nothing, nothing) == (0, 0, 50, 60)


def test_what_is_left_outside_at_the_border_is_told(monkeypatch: pytest.MonkeyPatch):
    outside = np.zeros((60, 50), bool)
    outside[:10] = True
    outside[10:20, :5] = True  # beside a gable
    outside[30:34, 20:24] = True  # a pane with sky in it
    monkeypatch.setattr(cut, "seen_outside", lambda picture: outside)
    image, hidden = np.random.default_rng(0).integers(0, 256, (60, 50, 3), dtype=np.uint8), np.zeros((60, 50), bool)
    hidden[50:55, 40:] = True
    found = cut_to_facade(image, hidden)
    assert found.box == (0, 10, 50, 60)
    assert (found.image == image[10:]).all()
    assert (found.hidden == hidden[10:]).all()
    expected = np.zeros((50, 50), bool)
    expected[:10, :5] = True
    assert (found.outside == expected).all()
    monkeypatch.setattr(cut, "seen_outside", lambda picture: np.ones((60, 50), bool))
    assert not cut_to_facade(image, hidden).outside.any()
