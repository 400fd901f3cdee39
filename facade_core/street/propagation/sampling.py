"""Sampling of atlas texels over each pixel's footprint on its chart."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import (
    BoolArray,
    Float32Array,
    Float64Array,
    Int32Array,
    Int64Array,
    UInt8Array,
    UInt16Array,
)
from facade_core.core.numba_cache import njit
from facade_core.core.provenance import Provenance

# Samples along either side of a footprint; only pixels near the horizon have longer ones.
MAX_SAMPLES = 16


class PanoramaPixels(NamedTuple):
    """Pixels of a panorama.

    Attributes
    ----------
    rays : (h, w, 3) unit directions.
    depth : (h, w) metres.
    chart : (h, w) chart index, negative for none.
    """

    rays: Float64Array
    depth: Float32Array
    chart: Int32Array


class ChartTexelFrames(NamedTuple):
    """Frames of all n charts and the offsets of their texels in the buffer.

    Attributes
    ----------
    origin, axis_u, axis_v, normal : (n, 3) frames.
    density : (n,) texels per metre.
    offset : (n,) index of a chart's first texel, negative if it is not in the buffer.
    width, height : (n,) texels.
    grey : (n,) 0..255, shading of an untextured surface.
    """

    origin: Float64Array
    axis_u: Float64Array
    axis_v: Float64Array
    normal: Float64Array
    density: Float64Array
    offset: Int64Array
    width: Int32Array
    height: Int32Array
    grey: Float64Array


class ViewGate(NamedTuple):
    """Distance gate of proper views.

    Attributes
    ----------
    forward : (2,) direction of the street.
    metres : greatest distance along it.
    """

    forward: Float64Array
    metres: float


class DaylightGrids(NamedTuple):
    """Soft daylight grids of all charts, as in `Daylight`.

    Attributes
    ----------
    place, columns, rows : (n,) first value and shape of each chart's grid.
    light : (k,) values of all grids.
    """

    place: Int64Array
    columns: Int64Array
    rows: Int64Array
    light: Float32Array


@njit(cache=True, inline="always")
def interpolate_light(x: float, y: float, place: int, columns: int, rows: int, lights: Float32Array) -> float:
    """Interpolate the light of a chart's grid bilinearly. Called from numba kernels.

    Parameters
    ----------
    x, y : shares of the chart's sides.
    place : index of the grid's first value.
    columns, rows : shape of the grid.
    lights : (k,) values of all grids.
    """
    u = min(max(x, 0.0), 1.0) * (columns - 1)
    v = min(max(y, 0.0), 1.0) * (rows - 1)
    u0, v0 = min(int(u), columns - 2), min(int(v), rows - 2)
    u1, v1 = u0 + 1, v0 + 1
    top = lights[place + v0 * columns + u0] * (1 - (u - u0)) + lights[place + v0 * columns + u1] * (u - u0)
    bottom = lights[place + v1 * columns + u0] * (1 - (u - u0)) + lights[place + v1 * columns + u1] * (u - u0)
    light: float = top * (1 - (v - v0)) + bottom * (v - v0)
    return light


@njit(cache=True, inline="always")
def _is_known(provenance: UInt8Array, views: UInt16Array, texel: int, near: bool) -> bool:
    """Return True if a texel has a colour; in a near view a fallback colour does not count."""
    if near and provenance[texel] == Provenance.TRANSLATED and texel < len(views) and views[texel] == 0:
        return False
    is_known: bool = provenance[texel] > Provenance.UNSEEN
    return is_known


@njit(cache=True, nogil=True)
def colour_panorama_pixels(
    pixels: PanoramaPixels,
    camera: Float64Array,
    charts: ChartTexelFrames,
    lights: DaylightGrids,
    atlas: UInt8Array,
    provenance: UInt8Array,
    views: UInt16Array,
    gate: ViewGate,
    rgb: UInt8Array,
    textured: BoolArray,
) -> None:
    """Colour the pixels that show a chart from its texels, in place.

    A pixel is textured if at least half of the texels under it are known. Its colour is their mean, or bilinear where
    the pixel is smaller than a texel. Within the gate a fallback colour does not count as known: colour seen from far
    would be copied from view to view.

    Parameters
    ----------
    pixels : pixels of the panorama.
    camera : (3,) position.
    charts : frames and texels of all charts.
    lights : soft daylight on the charts.
    atlas : (t, 3) colours of the buffer's texels.
    provenance : (t,) provenance of these texels.
    views : (w,) number of proper views of the first w texels.
    gate : distance gate of the viewpoint.
    rgb : (h, w, 3) output colour.
    textured : (h, w) output mask.
    """
    rays, depth, chart = pixels
    rows, columns = chart.shape
    origin, axis_u, axis_v, normal = charts.origin, charts.axis_u, charts.axis_v, charts.normal
    offset, width, height, grey = charts.offset, charts.width, charts.height, charts.grey
    place, cells_wide, cells_high, light = lights
    for r in range(rows):
        for c in range(columns):
            k = chart[r, c]
            if k < 0:
                continue
            ahead, t = 0.0, float(depth[r, c])
            for i in range(3):
                ahead += normal[k, i] * rays[r, c, i]
            if ahead > -1e-6:
                ahead = -1e-6
            # the texel under the pixel, and its offsets per pixel to the right and down
            next_column, next_row = (c + 1) % columns, min(r + 1, rows - 1)
            previous_row = next_row - 1
            leave_right, leave_down = 0.0, 0.0
            for i in range(3):
                leave_right += normal[k, i] * (rays[r, next_column, i] - rays[r, c, i])
                leave_down += normal[k, i] * (rays[next_row, c, i] - rays[previous_row, c, i])
            x, y, ax, ay, bx, by = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for i in range(3):
                ray = rays[r, c, i]
                point = camera[i] + t * ray - origin[k, i]
                right = t * (rays[r, next_column, i] - ray - ray * leave_right / ahead)
                down = t * (rays[next_row, c, i] - rays[previous_row, c, i] - ray * leave_down / ahead)
                x += point * axis_u[k, i]
                y += point * axis_v[k, i]
                ax += right * axis_u[k, i]
                ay += right * axis_v[k, i]
                bx += down * axis_u[k, i]
                by += down * axis_v[k, i]
            density = charts.density[k]
            x, y, ax, ay, bx, by = x * density, y * density, ax * density, ay * density, bx * density, by * density
            onward = t * (rays[r, c, 0] * gate.forward[0] + rays[r, c, 1] * gate.forward[1])
            near = abs(onward) <= gate.metres
            bare = int(
                grey[k] * interpolate_light(x / width[k], y / height[k], place[k], cells_wide[k], cells_high[k], light)
                + 0.5
            )
            rgb[r, c, 0] = rgb[r, c, 1] = rgb[r, c, 2] = bare
            first = offset[k]
            if first < 0:
                continue
            w, h = width[k], height[k]
            across = min(max(int(np.ceil(np.sqrt(ax * ax + ay * ay))), 1), MAX_SAMPLES)
            along = min(max(int(np.ceil(np.sqrt(bx * bx + by * by))), 1), MAX_SAMPLES)
            known, red, green, blue = 0.0, 0.0, 0.0, 0.0
            if across == 1 and along == 1:
                total = 1.0
                u, v = x - 0.5, y - 0.5
                u0, v0 = int(np.floor(u)), int(np.floor(v))
                for dv in range(2):
                    row = min(max(v0 + dv, 0), h - 1)
                    for du in range(2):
                        texel = first + row * w + min(max(u0 + du, 0), w - 1)
                        if _is_known(provenance, views, texel, near):
                            weight = (1.0 - abs(u - u0 - du)) * (1.0 - abs(v - v0 - dv))
                            known += weight
                            red += weight * atlas[texel, 0]
                            green += weight * atlas[texel, 1]
                            blue += weight * atlas[texel, 2]
            else:
                total = float(across * along)
                for j in range(along):
                    share_down = (j + 0.5) / along - 0.5
                    for i in range(across):
                        share_right = (i + 0.5) / across - 0.5
                        column = int(np.floor(x + share_right * ax + share_down * bx))
                        row = int(np.floor(y + share_right * ay + share_down * by))
                        texel = first + min(max(row, 0), h - 1) * w + min(max(column, 0), w - 1)
                        if _is_known(provenance, views, texel, near):
                            known += 1.0
                            red += atlas[texel, 0]
                            green += atlas[texel, 1]
                            blue += atlas[texel, 2]
            if known >= 0.5 * total:
                textured[r, c] = True
                rgb[r, c, 0] = int(red / known + 0.5)
                rgb[r, c, 1] = int(green / known + 0.5)
                rgb[r, c, 2] = int(blue / known + 0.5)
