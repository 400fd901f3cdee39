"""Where walls lie inside another building: party walls, which nobody can ever see."""

from __future__ import annotations

import numpy as np

from facade_core.geometry.charts import ChartKind
from facade_core.geometry.scene import Scene

# Metres between the places of a wall that are asked; what lies between four of them that are inside is inside too.
CELL_M = 0.5
# Asked this far before the wall: neighbours may stand so far apart.
BEFORE_M = 0.3
# And this far off a wall's edges: a ray from there may pass between two surfaces.
INSET_M = 0.02


def enclosed(scene: Scene, chart: int) -> np.ndarray:
    """The texels (h, w) bool of a chart that lie inside a building: none of what is no wall.

    A place is inside where a ray outward and one upward both meet a surface from behind.
    """
    height, width = int(scene.placement.height[chart]), int(scene.placement.width[chart])
    charts = scene.charts
    if charts.kind[chart] != ChartKind.WALL:
        return np.zeros((height, width), bool)
    columns, rows = np.maximum(np.ceil(charts.size[chart] / CELL_M), 1).astype(int) + 1
    across, down = (
        np.linspace(INSET_M, side - INSET_M, n) for side, n in zip(charts.size[chart], (columns, rows), strict=True)
    )
    normal = charts.normal()[chart]
    points = charts.points(chart, across[None], down[:, None]).reshape(-1, 3) + BEFORE_M * normal
    inside = _behind(scene, points, normal)
    inside[inside] = _behind(scene, points[inside], np.array([0.0, 0.0, 1.0]))
    corner = inside.reshape(rows, columns)
    cell = corner[1:, 1:] & corner[1:, :-1] & corner[:-1, 1:] & corner[:-1, :-1]
    row, column = (
        np.minimum((np.arange(n) + 0.5) / n * k, k - 1).astype(int)
        for n, k in zip((height, width), cell.shape, strict=True)
    )
    return cell[np.ix_(row, column)]


def _behind(scene: Scene, points: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Whether what rays from points (n, 3) along a direction (3,) meet first is met from behind: (n,) bool."""
    if not len(points):
        return np.zeros(0, bool)
    depth, hit = scene.caster.cast(points, np.broadcast_to(direction, points.shape))
    return np.isfinite(depth) & (scene.charts.normal()[hit] @ direction > 0)
