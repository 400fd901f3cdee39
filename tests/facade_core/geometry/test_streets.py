"""Viewpoints along centrelines: on the ground, outside buildings, also on short streets."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from shapely import LineString, box

from facade_core.geometry.streets import place_viewpoints

STREET = LineString([(0, 0), (40, 0)])


def test_every_spacing_from_half_a_spacing_on() -> None:
    positions, forward = place_viewpoints(STREET, spacing=5.0, height=2.5)
    np.testing.assert_allclose(positions[:, 0], np.arange(2.5, 40, 5))
    assert (positions[:, 2] == 2.5).all()
    np.testing.assert_allclose(forward, np.tile([1.0, 0.0], (8, 1)))


def test_cameras_stand_on_the_ground() -> None:
    positions, _ = place_viewpoints(STREET, spacing=5.0, height=2.5, ground=lambda xy: 100 + 0.1 * xy[:, 0])
    np.testing.assert_allclose(positions[:, 2], 102.5 + 0.1 * np.arange(2.5, 40, 5))


@pytest.mark.parametrize(("length", "places"), [(0.9, []), (1.0, [0.5]), (4.0, [2.0]), (5.0, [2.5]), (8.0, [2.5, 7.5])])
def test_a_short_street_is_seen_from_its_middle(length: float, places: list[float]) -> None:
    positions, forward = place_viewpoints(LineString([(0, 0), (0, length)]), spacing=5.0)
    np.testing.assert_allclose(positions[:, 1], places)
    np.testing.assert_allclose(forward, np.tile([0.0, 1.0], (len(places), 1)))


def test_none_inside_a_building_but_in_its_yard() -> None:
    building = box(10, -20, 30, 20).difference(box(14, -10, 26, 10))
    nowhere = place_viewpoints(STREET, obstacles=[box(-9, -9, 50, 9)], ground=lambda xy: xy[:, 0])
    assert nowhere[0].shape == (0, 3)
    assert nowhere[1].shape == (0, 2)
    for obstacles in ([building], shapely.STRtree([building])):
        positions, forward = place_viewpoints(STREET, obstacles=obstacles)
        np.testing.assert_allclose(positions[:, 0], [2.5, 7.5, 17.5, 22.5, 32.5, 37.5])
        assert len(forward) == len(positions)


def test_a_street_that_turns_back_on_itself_looks_somewhere() -> None:
    positions, forward = place_viewpoints(LineString([(0, 0), (2.5, 0), (0, 0)]), spacing=5.0)
    assert len(positions) == len(forward) == 0, "its middle is the turning point, which has no direction"


def test_a_ring_has_viewpoints_all_around() -> None:
    ring = LineString(box(0, 0, 25, 25).exterior.coords)
    positions, forward = place_viewpoints(ring, spacing=5.0)
    assert len(positions) == 20
    np.testing.assert_allclose(np.linalg.norm(forward, axis=1), 1)
