"""Distances from centrelines, found by a grid, against all centrelines at once."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from facade_core.street.centrelines import CELL_M, Centrelines
from facade_core.types import Street

REACH = 3.96


def _streets(lines: list[np.ndarray]) -> list[Street]:
    return [Street(str(i), "", shapely.LineString(line)) for i, line in enumerate(lines)]


@pytest.mark.parametrize("origin", [(0.0, 0.0), (25496000.0, 6672000.0)])
def test_within_reach_the_distance_is_that_from_all_centrelines(origin: tuple[float, float]) -> None:
    rng = np.random.default_rng(3)
    lines = [origin + 300 * rng.uniform(size=2) + np.cumsum(rng.normal(0, 25, (5, 2)), axis=0) for _ in range(60)]
    lines += [lines[0][::-1], np.array([(0, 0), (900, 870)]) + origin]  # the same again, and one far across all cells
    streets = _streets(lines)
    beside = np.concatenate(lines)[:, None] + rng.normal(0, 3, (1, 60, 2))
    points = np.concatenate([np.concatenate(lines), beside.reshape(-1, 2), origin + rng.uniform(-2e3, 2e3, (40000, 2))])
    found = Centrelines(streets, REACH).distance(points)
    wanted = shapely.distance(shapely.union_all([street.line for street in streets]), shapely.points(points))
    near = wanted <= REACH
    assert 5000 < near.sum() < len(points) / 2
    # GEOS may be built to round products and sums at once, on processors that do
    np.testing.assert_allclose(found[near], wanted[near], rtol=0, atol=1e-8)
    assert np.isinf(found[~near & (wanted > REACH + 1e-8)]).all()


def test_cells_of_centrelines_far_apart_are_few() -> None:
    streets = _streets([np.array([(0, 0), (50, 10)]), np.array([(1.5e5, 1.9e5), (1.5e5, 1.9e5 + CELL_M)])])
    found = Centrelines(streets, REACH)
    assert len(found._start) < 1.1 * 2**20
    assert found.distance(np.array([(1.5e5 - 2, 1.9e5 + 1), (7e4, 7e4), (50, 12)])).tolist() == [2, np.inf, 2]


def test_without_centrelines_nothing_is_near() -> None:
    assert np.isinf(Centrelines([], REACH).distance(np.zeros((3, 2)))).all()
    assert Centrelines([], REACH).distance(np.zeros((0, 2))).shape == (0,)
