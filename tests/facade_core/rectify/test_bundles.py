"""Which panoramas are refined together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.imagery.poses.bundles import (
    MAX_BUNDLE_SIZE,
    MAX_DAYS_APART,
    MIN_WALL_SHARE,
    group_panoramas_into_bundles,
)


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
    assert [len(one) for one in along_a_street(MAX_BUNDLE_SIZE)] == [MAX_BUNDLE_SIZE]
    assert [len(one) for one in along_a_street(7, without=3)] == [3, 3]


def test_many_are_cut_by_where_they_are_and_one_more_changes_its_own_bundle_alone() -> None:
    before, after = along_a_street(60), along_a_street(61)
    assert all(2 <= len(one) <= MAX_BUNDLE_SIZE for one in before)
    assert sum(map(len, before)) >= 58
    changed = [one for one in after if one not in before]
    assert len(changed) <= 2
    assert all(min(x for x, _ in one) > 1000 + 5 * (60 - MAX_BUNDLE_SIZE) for one in changed)


def test_cameras_in_one_place_are_cut_too() -> None:
    count = 2 * MAX_BUNDLE_SIZE + 1
    found = group_panoramas_into_bundles(
        np.zeros(count, int), np.arange(count), np.ones(count), np.zeros((count, 2)), [None] * count
    )
    assert [len(one) for one in found] == [MAX_BUNDLE_SIZE, MAX_BUNDLE_SIZE]


def test_walls_that_hardly_show_and_years_between_connect_nobody() -> None:
    wall, panorama, places = np.zeros(3, int), np.arange(3), np.zeros((3, 2))
    seen = np.array([0.9, MIN_WALL_SHARE, MIN_WALL_SHARE / 2])
    assert group_panoramas_into_bundles(wall, panorama, seen, places, [None] * 3) == [(0, 1)]
    days = [5, 5 + MAX_DAYS_APART + 1, 5 + MAX_DAYS_APART]
    assert group_panoramas_into_bundles(wall, panorama, np.ones(3), places, days) == [(0, 1, 2)], (
        "the third was taken near both"
    )
    assert group_panoramas_into_bundles(wall[:2], panorama[:2], seen[:2], places[:2], days[:2]) == []
    assert group_panoramas_into_bundles(np.zeros(0, int), np.zeros(0, int), np.zeros(0), np.zeros((0, 2)), []) == []
