"""Anisotropic texture filtering: each pixel averages its footprint on a surface."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import Float32Array, Float64Array, Int64Array, UInt8Array
from facade_core.core.numba_cache import njit

# Maximum number of samples along the longer axis of a pixel's footprint.
MAX_ANISOTROPY = 12
# Minimum sine of the grazing angle; more oblique surfaces are treated as if at this angle.
MIN_GRAZING_SINE = 0.01


class MipPyramid(NamedTuple):
    """Mip levels of a raster, each half as large as the previous one, as kernels read them.

    Attributes
    ----------
    texels : (k, 3) texels of all levels.
    first : (levels,) index of the first texel.
    rows, columns : (levels,) size.
    """

    texels: UInt8Array
    first: Int64Array
    rows: Int64Array
    columns: Int64Array


class PinholeCamera(NamedTuple):
    """Position, axes and focal length of a camera, as kernels read them.

    Attributes
    ----------
    position : (3,) world metres.
    ahead, right, down : (3,) unit vectors.
    focal : focal length, pixels.
    width, height : pixels.
    """

    position: Float64Array
    ahead: Float64Array
    right: Float64Array
    down: Float64Array
    focal: float
    width: int
    height: int


def build_mip_pyramid(raster: UInt8Array, coarsest: float) -> MipPyramid:
    """Halve a raster (h, w, 3) uint8 until a texel covers at least `coarsest` texels of the original."""
    import cv2

    levels = [raster]
    while 2 ** (len(levels) - 1) < coarsest and max(levels[-1].shape[:2]) > 1:
        rows, columns = (max(1, side // 2) for side in levels[-1].shape[:2])
        smaller = np.asarray(cv2.resize(levels[-1], (columns, rows), interpolation=cv2.INTER_AREA), np.uint8)
        levels.append(smaller.reshape(rows, columns, 3))
    shapes = np.array([level.shape[:2] for level in levels])
    area = shapes.prod(axis=1)
    texels = np.concatenate([level.reshape(-1, 3) for level in levels])
    return MipPyramid(texels, np.cumsum(area) - area, shapes[:, 0].copy(), shapes[:, 1].copy())


@njit(cache=True, nogil=True, error_model="numpy")
def paint_pixels(
    rgb: UInt8Array,
    pixel: Int64Array,
    depth: Float32Array,
    pinhole: PinholeCamera,
    origin: Float64Array,
    axes: Float64Array,
    density: Float64Array,
    levels: MipPyramid,
) -> None:
    """Paint, in place, the pixels that show a chart.

    Parameters
    ----------
    rgb : (n, 3) uint8 picture.
    pixel : (k,) pixels of the chart.
    depth : (k,) distances from the camera, metres.
    pinhole : the camera.
    origin : (3,) origin of the chart's frame.
    axes : (3, 3) right, down and outward of the chart.
    density : (2,) texels per metre to the right and down.
    levels : raster of the chart.
    """
    away = pinhole.position - origin
    for k in range(len(pixel)):
        row, column = divmod(pixel[k], pinhole.width)
        x = (column + 0.5 - pinhole.width / 2) / pinhole.focal
        y = (row + 0.5 - pinhole.height / 2) / pinhole.focal
        long = np.sqrt(1 + x * x + y * y)
        t = depth[k] / long
        u, v, slant = 0.0, 0.0, 0.0
        for i in range(3):
            ray = pinhole.ahead[i] + x * pinhole.right[i] + y * pinhole.down[i]
            u += (away[i] + t * ray) * axes[0, i]
            v += (away[i] + t * ray) * axes[1, i]
            slant += ray * axes[2, i]
        least = MIN_GRAZING_SINE * long
        slant = min(slant, -least) if slant < 0 else max(slant, least)
        # derivatives of the place by pixel steps to the right and down
        along_right, along_down = 0.0, 0.0
        for i in range(3):
            along_right += pinhole.right[i] * axes[2, i]
            along_down += pinhole.down[i] * axes[2, i]
        along_right, along_down = along_right / slant, along_down / slant
        ux, uy, vx, vy = 0.0, 0.0, 0.0, 0.0
        for i in range(3):
            ray = pinhole.ahead[i] + x * pinhole.right[i] + y * pinhole.down[i]
            dx = pinhole.right[i] - ray * along_right
            dy = pinhole.down[i] - ray * along_down
            ux += dx * axes[0, i]
            uy += dy * axes[0, i]
            vx += dx * axes[1, i]
            vy += dy * axes[1, i]
        step = t / pinhole.focal
        ux, uy, vx, vy = ux * step * density[0], uy * step * density[0], vx * step * density[1], vy * step * density[1]
        wide, high = np.sqrt(ux * ux + vx * vx), np.sqrt(uy * uy + vy * vy)
        if wide >= high:
            major, minor, du, dv = wide, high, ux, vx
        else:
            major, minor, du, dv = high, wide, uy, vy
        across = max(minor, major / MAX_ANISOTROPY, 1e-6)
        count = min(max(int(np.ceil(major / max(across, 1.0))), 1), MAX_ANISOTROPY)
        level = np.log2(max(across, 1.0))
        lower = min(int(level), len(levels.first) - 1)
        upper = min(lower + 1, len(levels.first) - 1)
        share = level - lower if upper > lower else 0.0
        red, green, blue = 0.0, 0.0, 0.0
        for j in range(count):
            at = (j + 0.5) / count - 0.5
            pu, pv = u * density[0] + at * du, v * density[1] + at * dv
            r, g, b = _bilinear(levels, lower, pu, pv)
            if share > 0:
                r2, g2, b2 = _bilinear(levels, upper, pu, pv)
                r, g, b = r + share * (r2 - r), g + share * (g2 - g), b + share * (b2 - b)
            red, green, blue = red + r, green + g, blue + b
        rgb[pixel[k], 0] = int(red / count + 0.5)
        rgb[pixel[k], 1] = int(green / count + 0.5)
        rgb[pixel[k], 2] = int(blue / count + 0.5)


@njit(cache=True, inline="always", error_model="numpy")
def _bilinear(levels: MipPyramid, level: int, u: float, v: float) -> tuple[float, float, float]:
    """Interpolate the colour of a level at a place in texels of the first level."""
    rows, columns, first = levels.rows[level], levels.columns[level], levels.first[level]
    x = min(max(u * columns / levels.columns[0] - 0.5, 0.0), columns - 1.0)
    y = min(max(v * rows / levels.rows[0] - 0.5, 0.0), rows - 1.0)
    x0, y0 = int(x), int(y)
    x1, y1 = min(x0 + 1, columns - 1), min(y0 + 1, rows - 1)
    fraction_x, fraction_y = x - x0, y - y0
    a, b = first + y0 * columns + x0, first + y0 * columns + x1
    c, d = first + y1 * columns + x0, first + y1 * columns + x1
    p, q = (1 - fraction_x) * (1 - fraction_y), fraction_x * (1 - fraction_y)
    r, s = (1 - fraction_x) * fraction_y, fraction_x * fraction_y
    t = levels.texels
    return (
        p * t[a, 0] + q * t[b, 0] + r * t[c, 0] + s * t[d, 0],
        p * t[a, 1] + q * t[b, 1] + r * t[c, 1] + s * t[d, 1],
        p * t[a, 2] + q * t[b, 2] + r * t[c, 2] + s * t[d, 2],
    )
