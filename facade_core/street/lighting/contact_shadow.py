"""Contact shadow along the line where a wall meets the ground, on both sides."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Float32Array, Float64Array
from facade_core.core.fixed_order import multiply_matrices
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.scene import Scene
from facade_core.street.lighting.settings import CONTACT_SHADOW


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
    near = charts.charts_within(chart, CONTACT_SHADOW.contact_reach_m)
    walls = near[charts.kind[near] == ChartKind.WALL]
    ends = charts.points_at_shares(walls, np.array([[0.0, 1.0], [1.0, 1.0]]))
    height_over_ground = multiply_matrices(ends - charts.origin[chart], charts.normals()[chart])
    # includes walls that begin below the ground and end above it
    touches_ground = (
        (height_over_ground < CONTACT_SHADOW.max_foot_gap_m)
        & (height_over_ground > CONTACT_SHADOW.max_foot_gap_m - charts.size[walls, 1:])
    ).all(axis=1)
    if not touches_ground.any():
        return None
    flat = charts.coordinates(
        np.full(2 * int(touches_ground.sum()), chart), ends[touches_ground].reshape(-1, 3)
    ).reshape(-1, 2, 2)
    width, height = int(scene.placement.width[chart]), int(scene.placement.height[chart])
    margin = int(np.ceil(CONTACT_SHADOW.contact_reach_m * density)) + 1
    free = np.full((height + 2 * margin, width + 2 * margin), 255, np.uint8)
    fixed_point = np.round((flat * density - 0.5 + margin) * 2**CONTACT_SHADOW.line_fraction_bits).astype(np.int64)
    for (x0, y0), (x1, y1) in np.clip(fixed_point, -(2**26), 2**26).tolist():
        cv2.line(free, (x0, y0), (x1, y1), 0, 1, cv2.LINE_8, CONTACT_SHADOW.line_fraction_bits)
    if free.all():
        return None
    distance = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_5)[margin:-margin, margin:-margin] / density
    return _remaining_light(distance, CONTACT_SHADOW.ground_loss)


def _wall_light(scene: Scene, chart: int) -> Float32Array | None:
    charts = scene.charts
    if not _is_on_ground(scene, chart):
        return None
    width, height = int(scene.placement.width[chart]), int(scene.placement.height[chart])
    height_over_foot = charts.size[chart, 1] - (np.arange(height) + 0.5) / scene.placement.texels_per_metre[chart]
    return np.broadcast_to(
        _remaining_light(np.maximum(height_over_foot, 0), CONTACT_SHADOW.wall_loss)[:, None], (height, width)
    )


def _is_on_ground(scene: Scene, chart: int) -> bool:
    """Return True if a wall's foot is on the ground, not on a roof or another wall."""
    charts = scene.charts
    foot = charts.points_at_shares(np.array([chart]), np.array([[0.5, 1.0]]))[0, 0]
    above = foot + 0.1 * charts.normals()[chart] + [0.0, 0.0, CONTACT_SHADOW.max_foot_gap_m]
    depth, hit = scene.caster.cast(above, np.array([[0.0, 0.0, -1.0]]))
    return bool(
        hit[0] >= 0 and charts.kind[hit[0]] == ChartKind.GROUND and depth[0] < 2 * CONTACT_SHADOW.max_foot_gap_m
    )


def _remaining_light(distance: Float64Array, loss: float) -> Float32Array:
    """Compute the light left at distances (...,) metres from a line that loses `loss`."""
    fading = loss * (
        np.exp(-distance / CONTACT_SHADOW.loss_decay_m)
        - np.exp(-CONTACT_SHADOW.contact_reach_m / CONTACT_SHADOW.loss_decay_m)
    )
    return (1 - np.where(distance < CONTACT_SHADOW.contact_reach_m, fading, 0.0)).astype(np.float32)
