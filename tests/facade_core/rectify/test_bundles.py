"""Which panoramas are refined together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.imagery.poses.bundles import group_panoramas_into_bundles
from facade_core.imagery.poses.settings import PANORAMA_BUNDLES


def along_a_street(
    count: int, days: Sequence[int | None] | None = None, without: int | None = None
) -> list[set[tuple[float, float]]]:
    """The bundles, as places, of cameras 5 m apart that each show a wall of their own and the next one's."""
    numbers = [n for n in range(count) if n != without]
    places = np.array([(1000.0 + 5 * n, 40.0) for n in numbers])
    wall = np.array([[n, n + 1] for n in numbers]).ravel()
    panorama = np.repeat(np.arange(len(numbers)), 2)
    found = group_panoramas_into_bundles(wall, panorama, np.full(len(wall), 0.6), places, days or [None] * len(numbers))
    assert found == sorted(found)
    return [{(float(x), float(y)) for x, y in places[list(bundle)]} for bundle in found]


def test_a_few_that_show_the_same_walls_are_one_bundle() -> None:
    assert [len(one) for one in along_a_street(PANORAMA_BUNDLES.max_bundle_size)] == [PANORAMA_BUNDLES.max_bundle_size]
    assert [len(one) for one in along_a_street(7, without=3)] == [3, 3]


def test_many_are_cut_by_where_they_are_and_one_more_changes_its_own_bundle_alone() -> None:
    before, after = along_a_street(60), along_a_street(61)
    assert all(2 <= len(one) <= PANORAMA_BUNDLES.max_bundle_size for one in before)
    assert sum(map(len, before)) >= 58
    changed = [one for one in after if one not in before]
    assert len(changed) <= 2
    assert all(min(x for x, _ in one) > 1000 + 5 * (60 - PANORAMA_BUNDLES.max_bundle_size) for one in changed)


def test_cameras_in_one_place_are_cut_too() -> None:
    count = 2 * PANORAMA_BUNDLES.max_bundle_size + 1
    found = group_panoramas_into_bundles(
        np.zeros(count, int), np.arange(count), np.ones(count), np.zeros((count, 2)), [None] * count
    )
    assert [len(one) for one in found] == [PANORAMA_BUNDLES.max_bundle_size, PANORAMA_BUNDLES.max_bundle_size]


def test_walls_that_hardly_show_and_years_between_connect_nobody() -> None:
    wall, panorama, places = np.zeros(3, int), np.arange(3), np.zeros((3, 2))
    seen = np.array([0.9, PANORAMA_BUNDLES.min_wall_share, PANORAMA_BUNDLES.min_wall_share / 2])
    assert group_panoramas_into_bundles(wall, panorama, seen, places, [None] * 3) == [(0, 1)]
    days = [5, 5 + PANORAMA_BUNDLES.max_days_apart + 1, 5 + PANORAMA_BUNDLES.max_days_apart]
    assert group_panoramas_into_bundles(wall, panorama, np.ones(3), places, days) == [(0, 1, 2)], (
        "the third was taken near both"
    )
    assert group_panoramas_into_bundles(wall[:2], panorama[:2], seen[:2], places[:2], days[:2]) == []
    assert group_panoramas_into_bundles(np.zeros(0, int), np.zeros(0, int), np.zeros(0), np.zeros((0, 2)), []) == []
