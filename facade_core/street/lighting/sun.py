"""Soft sun shadows in textures, by rays to a widened sun disk."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Float32Array, Float64Array, IntArray
from facade_core.core.fixed_order import multiply_matrices
from facade_core.core.types import Sun
from facade_core.geometry.charts import Charts
from facade_core.geometry.scene import Scene
from facade_core.street.lighting.settings import SUNLIGHT
from facade_core.street.materials.settings import MATERIAL_FIELD

# Linear light of a clear sky on level ground in the open, red, green and blue. With the sun's it is neutral where the sun is
# 45 degrees high, as cameras balance white: shadows are bluish, and light that walls reflect makes up for it.
CLEAR_SKY_LIGHT = np.array([0.89, 0.97, 1.13])
# Linear light of the sun at normal incidence, on the same scale.
SUN_LIGHT = np.array([2.50, 2.38, 2.15])


def sky_light(sun: Sun | None) -> Float64Array:
    """Return the linear light (3,) of the whole sky: clear with a sun, else overcast and neutral."""
    return np.ones(3) if sun is None else CLEAR_SKY_LIGHT


def sun_direction(sun: Sun) -> Float64Array:
    """Return the unit vector (3,) towards the sun."""
    azimuth, elevation = np.radians(sun.azimuth), np.radians(sun.elevation)
    return np.array([np.sin(azimuth) * np.cos(elevation), np.cos(azimuth) * np.cos(elevation), np.sin(elevation)])


def sun_disk_rays(sun: Sun) -> Float64Array:
    """Return unit directions (`disk_rays`, 3) that cover the sun's disk evenly.

    They lie on a spiral of equal areas.
    """
    towards = sun_direction(sun)
    right = np.cross(towards, [0.0, 0.0, 1.0])
    right /= np.sqrt((right**2).sum())
    radius = np.tan(np.radians(SUNLIGHT.disk_radius_deg)) * np.sqrt(
        (np.arange(SUNLIGHT.disk_rays) + 0.5) / SUNLIGHT.disk_rays
    )
    angle = np.pi * (3 - np.sqrt(5)) * np.arange(SUNLIGHT.disk_rays)
    rays = (
        towards + np.outer(radius * np.cos(angle), right) + np.outer(radius * np.sin(angle), np.cross(right, towards))
    )
    directions: Float64Array = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    return directions


def sunlight_share(scene: Scene, chart: int, sun: Sun) -> Float32Array:
    """Compute the share of sunlight (h, w) float32 on a chart.

    The share is the cosine of incidence where the sun is unoccluded, 0 in full shadow.

    Parameters
    ----------
    scene : the block's geometry.
    chart : row of the chart.
    sun : position of the sun.
    """
    import cv2

    charts, density = scene.charts, scene.placement.texels_per_metre[chart]
    width, height = int(scene.placement.width[chart]), int(scene.placement.height[chart])
    normal = charts.normals()[chart]
    cosine = float((normal * sun_direction(sun)).sum())
    if cosine <= 0:
        return np.zeros((height, width), np.float32)
    step = max(1, round(SUNLIGHT.sun_cell_m * density))
    rows, columns = -(-height // step), -(-width // step)
    y, x = ((np.arange(n) + 0.5) * step / density for n in (rows, columns))
    x, y = np.minimum(x, charts.size[chart, 0]), np.minimum(y, charts.size[chart, 1])
    visible_share = np.empty((rows, columns), np.float32)
    towards = sun_disk_rays(sun)
    batch_rows = max(1, SUNLIGHT.ray_batch // (columns * SUNLIGHT.disk_rays))
    for first in range(0, rows, batch_rows):
        batch = slice(first, first + batch_rows)
        points = charts.points(chart, x[None, :], y[batch, None]) + SUNLIGHT.ray_lift_m * normal
        visible_share[batch] = _visible_disk(scene, points.reshape(-1, 3), towards).reshape(-1, columns)
    resized = cv2.resize(visible_share, (columns * step, rows * step), interpolation=cv2.INTER_LINEAR)
    return cosine * resized.reshape(rows * step, columns * step)[:height, :width]


def _visible_disk(scene: Scene, points: Float64Array, towards: Float64Array) -> Float64Array:
    """Return the share (n,) of the rays (k, 3) to the sun's disk that nothing occludes at points (n, 3).

    Where those to its rim agree, so do the others.
    """

    def count_free(origins: Float64Array, rays: Float64Array) -> IntArray:
        shape = (len(origins), len(rays), 3)
        depth, _ = scene.caster.cast(np.broadcast_to(origins[:, None], shape), np.broadcast_to(rays, shape))
        count: IntArray = (depth > SUNLIGHT.max_shadow_reach_m).sum(axis=1)
        return count

    rim = SUNLIGHT.rim_rays
    free = count_free(points, towards[-rim:])
    share = free / rim
    is_penumbra = (free > 0) & (free < rim)
    share[is_penumbra] = (free[is_penumbra] + count_free(points[is_penumbra], towards[:-rim])) / len(towards)
    return share


def sun_in_chart_frame(charts: Charts, chart: int, sun: Sun) -> tuple[Float64Array, float]:
    """Return the direction to the sun in a chart's frame and the brightness of shadow.

    Returns
    -------
    (3,) along the chart's width, down and outward; brightness of shadow relative to full light.
    """
    frame = np.stack([charts.axis_u[chart], charts.axis_v[chart], charts.normals()[chart]])
    towards = multiply_matrices(frame, sun_direction(sun))
    sky = MATERIAL_FIELD.typical_light * CLEAR_SKY_LIGHT
    return towards, float(np.sqrt(sky / (sky + SUN_LIGHT * max(towards[2], 0.0))).mean())
