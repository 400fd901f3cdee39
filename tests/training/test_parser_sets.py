from __future__ import annotations

import numpy as np

from facade_core.core.labels import UNKNOWN
from training.parser.sets import paint_random_occluders


def test_painted_occluders_change_what_they_are_said_to_hide_and_nothing_else() -> None:
    """Over many views: what is called clear keeps its pixels, but for a blurred rim; most of what is hidden changes."""
    wall = np.full((240, 240, 3), (196, 170, 140), np.uint8)
    hidden, changed_hidden, clear, changed_clear = 0, 0, 0, 0
    for seed in range(12):
        image, occluder = paint_random_occluders(wall, 0.03, 240.0, np.random.default_rng(seed))
        assert set(np.unique(occluder)) <= {0, 1, UNKNOWN}
        changed = np.abs(image.astype(int) - wall).max(2) > 12
        hidden += int((occluder == 1).sum())
        changed_hidden += int((changed & (occluder == 1)).sum())
        clear += int((occluder == 0).sum())
        changed_clear += int((changed & (occluder == 0)).sum())
    assert hidden > 5_000
    assert changed_hidden > 0.6 * hidden
    assert changed_clear < 0.02 * clear


def test_equal_seeds_paint_equal_occluders() -> None:
    wall = np.full((120, 160, 3), 150, np.uint8)
    one, two = (paint_random_occluders(wall, 0.03, 120.0, np.random.default_rng(7)) for _ in range(2))
    np.testing.assert_array_equal(one[0], two[0])
    np.testing.assert_array_equal(one[1], two[1])
