"""Searches of triangles beside plain references over all of them."""

from __future__ import annotations

import numpy as np
import pytest

from facade_core.core.arrays import Float64Array
from facade_core.geometry.charts import Mesh
from facade_core.geometry.nearest_surface import NearestSurface
from facade_core.geometry.surface_crossings import RayCrossingCounter
from facade_core.geometry.triangle_groups import GROUP_SIZE, group_triangles


def triangles(count: int, seed: int) -> Float64Array:
    random = np.random.default_rng(seed)
    return random.uniform(0.0, 30.0, (count, 1, 3)) + random.normal(0.0, 2.0, (count, 3, 3))


def cube(low: float, high: float) -> Float64Array:
    """Return the 12 triangles of a cube."""
    corner = np.array(np.meshgrid(*[[low, high]] * 3, indexing="ij")).reshape(3, -1).T
    faces = [(0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)]
    return corner[[part for a, b, c, d in faces for part in ((a, b, c), (a, c, d))]]


@pytest.mark.parametrize("count", [1, GROUP_SIZE, 300])
def test_groups_hold_each_triangle_once_within_their_boxes(count: int) -> None:
    groups = group_triangles(triangles(count, 1))
    assert sorted(groups.order.tolist()) == list(range(count))
    group = np.arange(count) // GROUP_SIZE
    assert (groups.corners >= groups.low[group][:, None]).all()
    assert (groups.corners <= groups.high[group][:, None]).all()


def test_the_nearest_point_is_that_of_all_triangles() -> None:
    corners, random = triangles(300, 2), np.random.default_rng(3)
    points = random.uniform(-5.0, 35.0, (50, 3))
    surface = NearestSurface(
        Mesh(
            corners.reshape(-1, 3),
            np.arange(900).reshape(-1, 3),
            np.arange(300, dtype=np.int32),
            np.repeat(np.arange(300, dtype=np.int32), 3),
        )
    )
    found, chart = surface.find(points)
    weights = random.dirichlet(np.full(3, 0.5), 4000)  # points spread over every triangle
    spread = np.einsum("wc,tcj->twj", weights, corners)
    for point, nearest, of in zip(points, found, chart, strict=True):
        distance = np.linalg.norm(nearest - point)
        others = np.linalg.norm(spread - point, axis=2).min(axis=1)
        assert distance <= others.min() + 1e-9
        assert others[of] - distance < 0.2, "the point lies on the triangle that is named"


def test_crossings_tell_the_inside_of_a_shell() -> None:
    shell = np.concatenate([cube(0.0, 10.0), cube(20.0, 25.0)])
    facet = np.arange(len(shell)) // 2
    points = np.random.default_rng(4).uniform(-2.0, 27.0, (400, 3))
    inside = ((points > 0) & (points < 10)).all(axis=1) | ((points > 20) & (points < 25)).all(axis=1)
    nothing = np.full(len(points), -1)
    for ahead in ([0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]):
        directions = np.tile(ahead, (len(points), 1))
        for drawn in (1, 2):  # faces drawn twice count once
            counter = RayCrossingCounter(np.tile(shell, (drawn, 1, 1)), np.tile(facet, drawn))
            np.testing.assert_array_equal(counter.has_odd_crossings(points, directions, nothing), inside)


def test_a_facet_does_not_cross_itself() -> None:
    shell, facet = cube(0.0, 10.0), np.arange(12) // 2
    middle = shell.reshape(6, 6, 3).mean(axis=1)
    outward = middle - 5.0
    counter = RayCrossingCounter(shell, facet)
    assert not counter.has_odd_crossings(middle, outward, np.arange(6)).any()
    assert counter.has_odd_crossings(middle, -outward, np.arange(6)).all()


def test_an_empty_shell_has_no_inside() -> None:
    counter = RayCrossingCounter(np.empty((0, 3, 3)), np.empty(0, np.int64))
    assert not counter.has_odd_crossings(np.zeros((2, 3)), np.ones((2, 3)), np.zeros(2, np.int64)).any()
