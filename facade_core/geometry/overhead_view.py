"""What a picture from straight above shows of charts: what lies under the free sky."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from facade_core.geometry.charts import ChartKind
from facade_core.geometry.raycast import RayCaster
from facade_core.geometry.scene import Scene

# Rays start this far above a place: its surface's triangles may lie centimetres off its plane.
LIFT_M = 0.1
# A roof that leans more than this (cosine of its normal with the vertical) shows too few pixels from above: 75 degrees.
LEAST_UP = 0.26
# Texels that are looked at together: what each takes is many times its colour.
AT_ONCE = 1 << 17

# World places (n, 2), and the side of the square that each stands for, metres -> colour (n, 3) uint8 and whether it is known
# (n,).
Aerial = Callable[[np.ndarray, float], tuple[np.ndarray, np.ndarray]]


def shown_from_above(scene: Scene) -> np.ndarray:
    """The roofs that a picture from above can texture: (charts,) bool."""
    return (scene.charts.kind == ChartKind.ROOF) & (scene.charts.normal()[:, 2] > LEAST_UP)


def from_above(scene: Scene, chart: int, aerial: Aerial) -> tuple[np.ndarray, np.ndarray]:
    """A chart as a picture from above shows it: rgb (h, w, 3) uint8 of its raster, and known (h, w) bool, where the picture is
    known and nothing of the block is above."""
    height, width = int(scene.placement.height[chart]), int(scene.placement.width[chart])
    rgb, known = np.zeros((height, width, 3), np.uint8), np.zeros((height, width), bool)
    rows, side = max(1, AT_ONCE // width), 1 / float(scene.placement.texels_per_metre[chart])
    for top in range(0, height, rows):
        points = raster_points(scene, chart, np.arange(top, min(top + rows, height)) + 0.5, np.arange(width) + 0.5)
        flat = points.reshape(-1, 3)
        colour, seen = aerial(flat[:, :2], side)
        seen[seen] = free_above(scene.caster, flat[seen])
        rgb[top : top + rows] = np.where(seen[:, None], colour, 0).reshape(-1, width, 3)
        known[top : top + rows] = seen.reshape(-1, width)
    return rgb, known


def raster_points(scene: Scene, chart: int, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """World points (h, w, 3) of rows (h,) and columns (w,) of a chart's raster, in texels from its upper left corner."""
    step = 1 / scene.placement.texels_per_metre[chart]
    return scene.charts.points(chart, step * columns[None], step * rows[:, None])


def free_above(caster: RayCaster, points: np.ndarray) -> np.ndarray:
    """Whether nothing of the block lies above each world point (n, 3): (n,) bool."""
    if len(points) == 0:
        return np.zeros(0, bool)
    up = np.array([0.0, 0.0, 1.0])
    return ~np.isfinite(caster.cast(points + LIFT_M * up, np.broadcast_to(up, points.shape))[0])
