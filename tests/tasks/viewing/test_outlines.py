"""Outlines of buildings for the map, from the triangles of their roofs."""

from __future__ import annotations

import numpy as np

from facade_core.geometry.charts import ChartKind
from tasks.viewing.outlines import outline_buildings


def square(x: float, y: float, side: float) -> list[tuple[float, float, float]]:
    return [(x, y, 9.0), (x + side, y, 9.0), (x + side, y + side, 9.0), (x, y + side, 9.0)]


def test_a_roof_of_triangles_with_a_crack_is_one_ring_and_a_yard_stays_open() -> None:
    """The first building has a roof in two halves with a crack between them, the other a yard; a wall has no outline."""
    corners = [*square(0, 0, 10), *square(10.05, 0, 10)]
    frame = [(30, 0, 20, 5), (30, 15, 20, 5), (30, 5, 5, 10), (45, 5, 5, 10)]
    for x, y, width, depth in frame:
        corners += [(x, y, 6.0), (x + width, y, 6.0), (x + width, y + depth, 6.0), (x, y + depth, 6.0)]
    quads = len(corners) // 4
    triangles = np.array(
        [[4 * q + a, 4 * q + b, 4 * q + c] for q in range(quads) for a, b, c in ((0, 1, 2), (0, 2, 3))]
    )
    charts = {
        "kind": np.array([ChartKind.ROOF] * quads + [ChartKind.WALL]),
        "building": np.array([0, 0, 1, 1, 1, 1, 0]),
        "own": np.array([True, True, False, False, False, False, True]),
    }
    wall = np.array([[0, 1, 5]])
    mesh = {
        "vertices": np.array(corners, float),
        "triangles": np.concatenate([triangles, wall]),
        "triangle_chart": np.append(np.repeat(np.arange(quads), 2), quads),
    }
    whole, around = outline_buildings(charts, mesh)
    assert (whole.building, whole.is_own) == (0, True)
    [ring] = whole.rings
    assert len(ring) == 4
    assert np.allclose(np.ptp(np.array(ring), axis=0), (20.05, 10), atol=0.06)
    assert (around.building, around.is_own) == (1, False)
    assert sorted(len(ring) for ring in around.rings) == [4, 4]
