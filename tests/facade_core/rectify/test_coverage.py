"""Order of the pictures of a chart: the first ones show most of it together."""

from __future__ import annotations

import numpy as np

from facade_core.imagery.rectify.coverage import order_by_coverage
from facade_core.imagery.rectify.panorama import Sighting


def sighting(number: int, score: float, first: int, last: int) -> Sighting:
    is_seen = (np.arange(100) >= first) & (np.arange(100) < last)
    return Sighting(number, float(is_seen.mean()), 40.0, score, is_seen)


def order_indices(*sightings: Sighting) -> list[int]:
    return [one.panorama for one in order_by_coverage(sightings)]


def test_pictures_of_parts_that_no_other_shows_come_first() -> None:
    best, same, rest = sighting(0, 0.6, 0, 70), sighting(1, 0.5, 0, 65), sighting(2, 0.1, 60, 100)
    assert order_indices(best, same, rest) == [0, 2, 1]


def test_pictures_of_the_whole_keep_their_order() -> None:
    assert order_indices(sighting(3, 0.6, 0, 100), sighting(1, 0.5, 0, 100), sighting(2, 0.4, 0, 95)) == [3, 1, 2]
    assert order_indices(sighting(0, 0.6, 0, 95), sighting(1, 0.5, 0, 95), sighting(2, 0.4, 5, 100)) == [
        0,
        1,
        2,
    ]  # adds .05
    assert order_indices() == []
