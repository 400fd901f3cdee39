"""Detection of party walls: parts of walls inside another building."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array
from facade_core.core.fixed_order import multiply_matrices
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.scene import Scene
from facade_core.geometry.settings import PARTY_WALLS


def find_enclosed_texels(scene: Scene, chart: int) -> BoolArray:
    """Return the texels (h, w) of a wall that are inside a building; none for charts of other kinds.

    A probe is inside where a ray outwards and a ray upwards both hit a back face first.
    """
    height, width = scene.placement.shape(chart)
    charts = scene.charts
    if charts.kind[chart] != ChartKind.WALL:
        return np.zeros((height, width), bool)
    columns, rows = np.maximum(np.ceil(charts.size[chart] / PARTY_WALLS.probe_spacing_m), 1).astype(int) + 1
    across, down = (
        np.linspace(PARTY_WALLS.edge_inset_m, side - PARTY_WALLS.edge_inset_m, n)
        for side, n in zip(charts.size[chart], (columns, rows), strict=True)
    )
    normal = charts.normals()[chart]
    points = charts.points(chart, across[None], down[:, None]).reshape(-1, 3) + PARTY_WALLS.probe_distance_m * normal
    inside = _hits_back_face(scene, points, normal)
    inside[inside] = _hits_back_face(scene, points[inside], np.array([0.0, 0.0, 1.0]))
    corner = inside.reshape(rows, columns)
    cell = corner[1:, 1:] & corner[1:, :-1] & corner[:-1, 1:] & corner[:-1, :-1]
    row, column = (
        np.minimum((np.arange(n) + 0.5) / n * k, k - 1).astype(int)
        for n, k in zip((height, width), cell.shape, strict=True)
    )
    return cell[np.ix_(row, column)]


def _hits_back_face(scene: Scene, points: Float64Array, direction: Float64Array) -> BoolArray:
    """Return whether rays from points (n, 3) along a direction (3,) hit a back face first: (n,)."""
    if not len(points):
        return np.zeros(0, bool)
    depth, hit = scene.caster.cast(points, np.broadcast_to(direction, points.shape))
    return np.isfinite(depth) & (multiply_matrices(scene.charts.normals()[hit], direction) > 0)
