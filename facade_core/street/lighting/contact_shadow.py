"""Contact shadow along the line where a wall meets the ground, on both sides."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Float32Array, Float64Array
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.scene import Scene

# Share of light lost at the line, on the ground and on the wall.
GROUND_LOSS = 0.38
WALL_LOSS = 0.24
# Distance from the line over which the loss decays to a third.
LOSS_DECAY_M = 0.3
# Distance from the line beyond which nothing is lost.
CONTACT_REACH_M = 1.2
# Largest gap between a wall's foot and the ground.
MAX_FOOT_GAP_M = 0.35
# Fraction bits of line coordinates.
LINE_FRACTION_BITS = 4


def contact_light(scene: Scene, chart: int) -> Float32Array | None:
    """Compute the share of light that contact shadows leave on ground or a wall.

    Returns
    -------
    (h, w) float32; None where nothing is lost.
    """
    kind = scene.charts.kind[chart]
    if kind == ChartKind.GROUND:
        return _ground_light(scene, chart)
    return _wall_light(scene, chart) if kind == ChartKind.WALL else None


def _ground_light(scene: Scene, chart: int) -> Float32Array | None:
    import cv2

    charts, density = scene.charts, scene.placement.texels_per_metre[chart]
    near = charts.charts_within(chart, CONTACT_REACH_M)
    walls = near[charts.kind[near] == ChartKind.WALL]
    ends = charts.points_at_shares(walls, np.array([[0.0, 1.0], [1.0, 1.0]]))
    height_over_ground = (ends - charts.origin[chart]) @ charts.normals()[chart]
    # includes walls that begin below the ground and end above it
    touches_ground = (
        (height_over_ground < MAX_FOOT_GAP_M) & (height_over_ground > MAX_FOOT_GAP_M - charts.size[walls, 1:])
    ).all(axis=1)
    if not touches_ground.any():
        return None
    flat = charts.coordinates(
        np.full(2 * int(touches_ground.sum()), chart), ends[touches_ground].reshape(-1, 3)
    ).reshape(-1, 2, 2)
    width, height = int(scene.placement.width[chart]), int(scene.placement.height[chart])
    margin = int(np.ceil(CONTACT_REACH_M * density)) + 1
    free = np.full((height + 2 * margin, width + 2 * margin), 255, np.uint8)
    fixed_point = np.round((flat * density - 0.5 + margin) * 2**LINE_FRACTION_BITS).astype(np.int64)
    for (x0, y0), (x1, y1) in np.clip(fixed_point, -(2**26), 2**26).tolist():
        cv2.line(free, (x0, y0), (x1, y1), 0, 1, cv2.LINE_8, LINE_FRACTION_BITS)
    if free.all():
        return None
    distance = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_5)[margin:-margin, margin:-margin] / density
    return _remaining_light(distance, GROUND_LOSS)


def _wall_light(scene: Scene, chart: int) -> Float32Array | None:
    charts = scene.charts
    if not _is_on_ground(scene, chart):
        return None
    width, height = int(scene.placement.width[chart]), int(scene.placement.height[chart])
    height_over_foot = charts.size[chart, 1] - (np.arange(height) + 0.5) / scene.placement.texels_per_metre[chart]
    return np.broadcast_to(_remaining_light(np.maximum(height_over_foot, 0), WALL_LOSS)[:, None], (height, width))


def _is_on_ground(scene: Scene, chart: int) -> bool:
    """Return True if a wall's foot is on the ground, not on a roof or another wall."""
    charts = scene.charts
    foot = charts.points_at_shares(np.array([chart]), np.array([[0.5, 1.0]]))[0, 0]
    above = foot + 0.1 * charts.normals()[chart] + [0.0, 0.0, MAX_FOOT_GAP_M]
    depth, hit = scene.caster.cast(above, np.array([[0.0, 0.0, -1.0]]))
    return bool(hit[0] >= 0 and charts.kind[hit[0]] == ChartKind.GROUND and depth[0] < 2 * MAX_FOOT_GAP_M)


def _remaining_light(distance: Float64Array, loss: float) -> Float32Array:
    """Compute the light left at distances (...,) metres from a line that loses `loss`."""
    fading = loss * (np.exp(-distance / LOSS_DECAY_M) - np.exp(-CONTACT_REACH_M / LOSS_DECAY_M))
    return (1 - np.where(distance < CONTACT_REACH_M, fading, 0.0)).astype(np.float32)
