"""Selection of the chart tiles that a panorama's pixels may fall on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, Int32Array, Int64Array
from facade_core.core.numba_cache import njit

# Texels along the side of a tile.
VISIBLE_TILE_TEXELS = 16
# Texels by which the projected edges of a pixel may bulge between its corners.
PIXEL_MARGIN_TEXELS = 1.0


class FacingCharts(NamedTuple):
    """Charts that face a viewpoint, k of them.

    Attributes
    ----------
    origin : (k, 3) relative to the camera.
    axis_u, axis_v, normal : (k, 3).
    farthest : (k,) metres from the camera up to which a texel counts.
    step : (k,) metres per texel.
    width, height : (k,) texels.
    surface : (k,) uncut surface of each chart.
    offset : (k,) first texel in the texel buffer.
    """

    origin: Float64Array
    axis_u: Float64Array
    axis_v: Float64Array
    normal: Float64Array
    farthest: Float64Array
    step: Float64Array
    width: Int64Array
    height: Int64Array
    surface: Int32Array
    offset: Int64Array


@njit(cache=True, nogil=True, inline="always")
def _collect_near_charts(
    seen: Int32Array, surface: Int32Array, place: Int64Array, r: int, c: int, near: Int64Array
) -> int:
    """Collect the charts of a pixel's surface on it and its neighbours into `near` (9,), by place; returns their number."""
    rows, columns = seen.shape
    count = 0
    for dr in range(-1, 2):
        row = min(max(r + dr, 0), rows - 1)
        for dc in range(-1, 2):
            column = (c + dc) % columns
            if seen[row, column] < 0 or surface[row, column] != surface[r, c]:
                continue
            k = place[seen[row, column]]
            fresh = k >= 0
            for i in range(count):
                if near[i] == k:
                    fresh = False
            if fresh:
                near[count] = k
                count += 1
    return count


@njit(cache=True, nogil=True)
def mark_visible_texel_tiles(
    seen: Int32Array, surface: Int32Array, place: Int64Array, camera: Float64Array, charts: FacingCharts
) -> BoolArray:
    """Mark the texel tiles of charts on which the pixels of a panorama may fall.

    Parameters
    ----------
    seen, surface : (h, w) chart and surface per pixel.
    place : (charts,) position of a chart in `charts`, -1 for others.
    camera : (3, 3) camera_from_world rotation.
    charts : the charts that face the viewpoint.

    Returns
    -------
    (tiles,) flags, chart by chart, row-major.
    """
    rows, columns = seen.shape
    origin, axis_u, axis_v, normal = charts.origin, charts.axis_u, charts.axis_v, charts.normal
    farthest = charts.farthest
    tiles_wide, tiles_high = (
        (charts.width + (VISIBLE_TILE_TEXELS - 1)) // VISIBLE_TILE_TEXELS,
        (charts.height + (VISIBLE_TILE_TEXELS - 1)) // VISIBLE_TILE_TEXELS,
    )
    first = np.zeros(len(origin) + 1, np.int64)
    for k in range(len(origin)):
        first[k + 1] = first[k] + tiles_wide[k] * tiles_high[k]
    marked = np.zeros(first[-1], np.bool_)
    sine, cosine, rise, level = (np.empty(columns + 1), np.empty(columns + 1), np.empty(rows + 1), np.empty(rows + 1))
    for c in range(columns + 1):
        longitude = (c / columns - 0.5) * 2 * np.pi
        sine[c], cosine[c] = np.sin(longitude), np.cos(longitude)
    for r in range(rows + 1):
        latitude = (0.5 - r / rows) * np.pi
        rise[r], level[r] = np.sin(latitude), np.cos(latitude)
    facing = np.zeros(len(origin))
    for k in range(len(origin)):
        for axis in range(3):
            facing[k] -= normal[k, axis] * origin[k, axis]
    near = np.empty(9, np.int64)
    for r in range(rows):
        for c in range(columns):
            if seen[r, c] < 0:
                continue
            for i in range(_collect_near_charts(seen, surface, place, r, c, near)):
                k = near[i]
                if facing[k] <= 0:
                    continue
                low_x, low_y, high_x, high_y = np.inf, np.inf, -np.inf, -np.inf
                for corner in range(4):
                    across, down = c + corner % 2, r + corner // 2
                    right, ahead = level[down] * sine[across], level[down] * cosine[across]
                    x, y, fall = 0.0, 0.0, 0.0
                    for axis in range(3):
                        ray = camera[0, axis] * right - camera[1, axis] * rise[down] + camera[2, axis] * ahead
                        x += ray * axis_u[k, axis]
                        y += ray * axis_v[k, axis]
                        fall -= ray * normal[k, axis]
                    t = facing[k] / fall if fall * farthest[k] > facing[k] else farthest[k]
                    x, y = t * x, t * y
                    low_x, high_x = min(low_x, x), max(high_x, x)
                    low_y, high_y = min(low_y, y), max(high_y, y)
                left, top = 0.0, 0.0
                for axis in range(3):
                    left += origin[k, axis] * axis_u[k, axis]
                    top += origin[k, axis] * axis_v[k, axis]
                step = charts.step[k]
                x0 = max(0, int(np.floor(((low_x - left) / step - PIXEL_MARGIN_TEXELS) / VISIBLE_TILE_TEXELS)))
                y0 = max(0, int(np.floor(((low_y - top) / step - PIXEL_MARGIN_TEXELS) / VISIBLE_TILE_TEXELS)))
                x1 = min(
                    tiles_wide[k] - 1,
                    int(np.floor(((high_x - left) / step + PIXEL_MARGIN_TEXELS) / VISIBLE_TILE_TEXELS)),
                )
                y1 = min(
                    tiles_high[k] - 1,
                    int(np.floor(((high_y - top) / step + PIXEL_MARGIN_TEXELS) / VISIBLE_TILE_TEXELS)),
                )
                for tile_row in range(y0, y1 + 1):
                    start = first[k] + tile_row * tiles_wide[k]
                    for tile in range(start + x0, start + x1 + 1):
                        marked[tile] = True
    return marked
