"""Where walls stand on the ground: what lies close beside the line sees little light, on both sides of it."""

from __future__ import annotations

import numpy as np

from facade_core.geometry.charts import ChartKind
from facade_core.geometry.scene import Scene

# How much of the light is lost at the line, on the ground and on the wall, and metres within which two thirds of that is gone.
GROUND_LOST, WALL_LOST, FADES_M = 0.38, 0.24, 0.3
# What is farther from the line loses nothing.
REACH_M = 1.2
# A wall's foot may stand this far off the ground, metres.
OFF_M = 0.35
# Fixed-point bits of the places of lines.
BITS = 4


def contact(scene: Scene, chart: int) -> np.ndarray | None:
    """The share of light (h, w) float32 that is left on the texels of a piece of ground or of a wall; None where all is."""
    kind = scene.charts.kind[chart]
    if kind == ChartKind.GROUND:
        return _on_ground(scene, chart)
    return _on_wall(scene, chart) if kind == ChartKind.WALL else None


def _on_ground(scene: Scene, chart: int) -> np.ndarray | None:
    import cv2

    charts, density = scene.charts, scene.placement.texels_per_metre[chart]
    near = charts.near(chart, REACH_M)
    walls = near[charts.kind[near] == ChartKind.WALL]
    ends = charts.at_shares(walls, np.array([[0.0, 1.0], [1.0, 1.0]]))
    over = (ends - charts.origin[chart]) @ charts.normal()[chart]
    # also walls that go on below the ground, and end above it
    stands = ((over < OFF_M) & (over > OFF_M - charts.size[walls, 1:])).all(axis=1)
    if not stands.any():
        return None
    flat = charts.coordinates(np.full(2 * int(stands.sum()), chart), ends[stands].reshape(-1, 3)).reshape(-1, 2, 2)
    width, height = int(scene.placement.width[chart]), int(scene.placement.height[chart])
    margin = int(np.ceil(REACH_M * density)) + 1
    free = np.full((height + 2 * margin, width + 2 * margin), 255, np.uint8)
    at = np.round((flat * density - 0.5 + margin) * 2**BITS).astype(np.int64)
    for (x0, y0), (x1, y1) in np.clip(at, -(2**26), 2**26).tolist():
        cv2.line(free, (x0, y0), (x1, y1), 0, 1, cv2.LINE_8, BITS)
    if free.all():
        return None
    away = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_5)[margin:-margin, margin:-margin] / density
    return _left(away, GROUND_LOST)


def _on_wall(scene: Scene, chart: int) -> np.ndarray | None:
    charts = scene.charts
    if not _stands(scene, chart):
        return None
    width, height = int(scene.placement.width[chart]), int(scene.placement.height[chart])
    over = charts.size[chart, 1] - (np.arange(height) + 0.5) / scene.placement.texels_per_metre[chart]
    return np.broadcast_to(_left(np.maximum(over, 0), WALL_LOST)[:, None], (height, width))


def _stands(scene: Scene, chart: int) -> bool:
    """Whether a wall's foot is on the ground, and on no roof or other wall."""
    charts = scene.charts
    foot = charts.at_shares(np.array([chart]), np.array([[0.5, 1.0]]))[0, 0]
    above = foot + 0.1 * charts.normal()[chart] + [0.0, 0.0, OFF_M]
    depth, hit = scene.caster.cast(above, np.array([[0.0, 0.0, -1.0]]))
    return bool(hit[0] >= 0 and charts.kind[hit[0]] == ChartKind.GROUND and depth[0] < 2 * OFF_M)


def _left(away: np.ndarray, lost: float) -> np.ndarray:
    """The light that is left at distances (...,) metres from the line, where `lost` of it is lost at the line."""
    fading = lost * (np.exp(-away / FADES_M) - np.exp(-REACH_M / FADES_M))
    return (1 - np.where(away < REACH_M, fading, 0.0)).astype(np.float32)
