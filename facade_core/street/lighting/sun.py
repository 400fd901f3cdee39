"""A soft sun in the textures: what stands in the block casts shadows, by rays to the sun's disk, widened."""

from __future__ import annotations

import numpy as np

from facade_core.core.types import Sun
from facade_core.geometry.charts import Charts
from facade_core.geometry.scene import Scene

# Radius of the disk, degrees: six times the sun's own, as through thin haze. Rays to it.
DISK_RADIUS_DEG, DISK_RAYS = 1.6, 9
# Metres between places that are looked from; light is linear between them. Rays start so far off the surface.
SUN_CELL_M, RAY_LIFT_M = 0.25, 0.04
# What stands farther casts no shadow.
MAX_SHADOW_REACH_M = 150.0
# Light of the sky alone and of the sun straight on, red, green and blue: what is in the shade is cooler.
SKY_LIGHT, SUN_LIGHT = np.array([0.75, 0.77, 0.81]), np.array([0.79, 0.73, 0.63])
# Rays that are cast together.
RAY_BATCH = 1 << 19


def sun_direction(sun: Sun) -> np.ndarray:
    """Towards the sun, unit (3,)."""
    turn, rise = np.radians(sun.azimuth), np.radians(sun.elevation)
    return np.array([np.sin(turn) * np.cos(rise), np.cos(turn) * np.cos(rise), np.sin(rise)])


def sun_disk_rays(sun: Sun) -> np.ndarray:
    """Unit directions (RAYS, 3) that cover its disk evenly: a spiral of equal areas."""
    towards = sun_direction(sun)
    right = np.cross(towards, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    radius = np.tan(np.radians(DISK_RADIUS_DEG)) * np.sqrt((np.arange(DISK_RAYS) + 0.5) / DISK_RAYS)
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(DISK_RAYS)
    rays = towards + np.outer(radius * np.cos(turn), right) + np.outer(radius * np.sin(turn), np.cross(right, towards))
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)


def sunlight_share(scene: Scene, chart: int, sun: Sun) -> np.ndarray:
    """How much of the sun's light falls on the texels of a chart, (h, w) float32: the cosine of its angle where nothing stands
    between, 0 in full shade."""
    import cv2

    charts, density = scene.charts, scene.placement.texels_per_metre[chart]
    width, height = int(scene.placement.width[chart]), int(scene.placement.height[chart])
    normal = charts.normal()[chart]
    cosine = float(normal @ sun_direction(sun))
    if cosine <= 0:
        return np.zeros((height, width), np.float32)
    step = max(1, round(SUN_CELL_M * density))
    rows, columns = -(-height // step), -(-width // step)
    y, x = ((np.arange(n) + 0.5) * step / density for n in (rows, columns))
    x, y = np.minimum(x, charts.size[chart, 0]), np.minimum(y, charts.size[chart, 1])
    seen = np.empty((rows, columns), np.float32)
    towards = sun_disk_rays(sun)
    together = max(1, RAY_BATCH // (columns * DISK_RAYS))
    for first in range(0, rows, together):
        own = slice(first, first + together)
        points = charts.points(chart, x[None, :], y[own, None]) + RAY_LIFT_M * normal
        rays = np.broadcast_to(towards, (*points.shape[:2], DISK_RAYS, 3))
        depth, _ = scene.caster.cast(np.broadcast_to(points[:, :, None], rays.shape), rays)
        seen[own] = (depth > MAX_SHADOW_REACH_M).mean(axis=2)
    finer = cv2.resize(seen, (columns * step, rows * step), interpolation=cv2.INTER_LINEAR)
    return cosine * finer.reshape(rows * step, columns * step)[:height, :width]


def sun_in_chart_frame(charts: Charts, chart: int, sun: Sun) -> tuple[np.ndarray, float]:
    """Towards the sun (3,) along a chart's width, down it and out of it; and how bright its shade is, of its light."""
    frame = np.stack([charts.axis_u[chart], charts.axis_v[chart], charts.normal()[chart]])
    towards = frame @ sun_direction(sun)
    return towards, float((SKY_LIGHT / (SKY_LIGHT + SUN_LIGHT * max(towards[2], 0.0))).mean())


def apply_sunlight(colour: np.ndarray, light: np.ndarray) -> np.ndarray:
    """A colour (h, w, 3) uint8 in the sky's light and so much of the sun's (h, w): (h, w, 3) uint8."""
    out = np.empty_like(colour)
    for band, (above, beside) in enumerate(zip(SKY_LIGHT.tolist(), SUN_LIGHT.tolist(), strict=True)):
        out[..., band] = np.minimum(colour[..., band] * (above + beside * light) + np.float32(0.5), 255)
    return out
