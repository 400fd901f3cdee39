"""Orthographic views of charts from above, where nothing of the block covers them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, FloatArray, UInt8Array
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.raycast import RayCaster
from facade_core.geometry.scene import Scene
from facade_core.geometry.settings import OVERHEAD

# World places (n, 2) and the side in metres of the square around each -> colour (n, 3) uint8, known (n,) bool.
AerialSampler = Callable[[Float64Array, float], tuple[UInt8Array, BoolArray]]


def upward_roof_mask(scene: Scene) -> BoolArray:
    """Mask the roof charts (charts,) that face up enough for a picture from above to texture."""
    is_seen_roof: BoolArray = (scene.charts.kind == ChartKind.ROOF) & (
        scene.charts.normals()[:, 2] > OVERHEAD.min_up_cosine
    )
    return is_seen_roof


def resample_aerial_to_chart(scene: Scene, chart: int, aerial: AerialSampler) -> tuple[UInt8Array, BoolArray]:
    """Resample an aerial picture to a chart's raster, where nothing of the block covers it.

    Parameters
    ----------
    chart : index of the chart.
    aerial : sampler of the picture.

    Returns
    -------
    (height, width, 3) RGB, and (height, width) True where the picture is known and nothing of the block covers the
    texel.
    """
    height, width = scene.placement.shape(chart)
    rgb, known = np.zeros((height, width, 3), np.uint8), np.zeros((height, width), bool)
    rows, side = max(1, OVERHEAD.texels_per_batch // width), 1 / float(scene.placement.texels_per_metre[chart])
    for top in range(0, height, rows):
        points = texel_points(scene, chart, np.arange(top, min(top + rows, height)) + 0.5, np.arange(width) + 0.5)
        flat = points.reshape(-1, 3)
        colour, seen = aerial(flat[:, :2], side)
        seen[seen] = has_free_sky(scene.caster, flat[seen])
        rgb[top : top + rows] = np.where(seen[:, None], colour, 0).reshape(-1, width, 3)
        known[top : top + rows] = seen.reshape(-1, width)
    return rgb, known


def texel_points(scene: Scene, chart: int, rows: FloatArray, columns: FloatArray) -> Float64Array:
    """Return the world points of texels of a chart.

    Parameters
    ----------
    chart : index of the chart.
    rows, columns : (h,) and (w,) in texels from the upper left corner of the raster.

    Returns
    -------
    (h, w, 3) metres.
    """
    step = 1 / scene.placement.texels_per_metre[chart]
    return scene.charts.points(chart, step * columns[None], step * rows[:, None])


def has_free_sky(caster: RayCaster, points: Float64Array) -> BoolArray:
    """Return whether nothing of the block is above each world point (n, 3): (n,)."""
    if len(points) == 0:
        return np.zeros(0, bool)
    up = np.array([0.0, 0.0, 1.0])
    return ~np.isfinite(caster.cast(points + OVERHEAD.overhead_lift_m * up, np.broadcast_to(up, points.shape))[0])
