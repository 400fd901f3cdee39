"""Area means of an image under small parallelograms, for texels that cover many pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facade_core.core.arrays import Int64Array, UInt8Array
from facade_core.core.numba_cache import njit

# Samples along each side of a parallelogram; the pyramid covers parallelograms that are long in both
# directions.
MAX_SAMPLES = 12


@dataclass(frozen=True, slots=True)
class Pyramid:
    """Image and its halvings in one array.

    Attributes
    ----------
    pixels : (n, 3) uint8.
    levels : (l, 3) int64 first pixel, height and width of each level.
    """

    pixels: UInt8Array
    levels: Int64Array


def build_pyramid(image: UInt8Array) -> Pyramid:
    """Build the pyramid of an RGB image (h, w, 3) uint8, halved down to one pixel."""
    import cv2

    images = [np.ascontiguousarray(image)]
    while max(images[-1].shape[:2]) > 1:
        height, width = ((side + 1) // 2 for side in images[-1].shape[:2])
        images.append(np.asarray(cv2.resize(images[-1], (width, height), interpolation=cv2.INTER_AREA), np.uint8))
    first = np.cumsum([0, *(level.shape[0] * level.shape[1] for level in images[:-1])])
    levels = np.array([(start, *level.shape[:2]) for start, level in zip(first, images, strict=True)], np.int64)
    return Pyramid(np.concatenate([level.reshape(-1, 3) for level in images]), levels)


@njit(cache=True, nogil=True)
def write_parallelogram_mean(
    pixels: UInt8Array,
    levels: Int64Array,
    x: float,
    y: float,
    ax: float,
    ay: float,
    bx: float,
    by: float,
    repeat: bool,
    out: UInt8Array,
) -> None:
    """Write an image's mean colour over a parallelogram into `out`.

    Beyond the image the content repeats, or the border does. Magnified pixels are interpolated by a cubic
    (Catmull-Rom).

    Parameters
    ----------
    pixels, levels : arrays of a `Pyramid`.
    x, y : centre in pixels of the largest level.
    ax, ay : first side of the parallelogram.
    bx, by : second side.
    repeat : repeat the image beyond its border.
    out : (3,) uint8; changed in place.
    """
    along, across = np.hypot(ax, ay), np.hypot(bx, by)
    level = int(np.log2(max(1.0, min(along, across))))
    level = min(level, len(levels) - 1)
    start, height, width = levels[level]
    sx, sy = width / levels[0, 2], height / levels[0, 1]
    shrink = 0.5**level
    m = min(MAX_SAMPLES, max(1, int(np.ceil(along * shrink - 1e-3))))
    n = min(MAX_SAMPLES, max(1, int(np.ceil(across * shrink - 1e-3))))
    red, green, blue = 0.0, 0.0, 0.0
    cubic = m * n == 1
    reach = 2 if cubic else 1
    for j in range(n):
        t = (j + 0.5) / n - 0.5
        for i in range(m):
            s = (i + 0.5) / m - 0.5
            px = (x + s * ax + t * bx) * sx - 0.5
            py = (y + s * ay + t * by) * sy - 0.5
            x0, y0 = int(np.floor(px)), int(np.floor(py))
            fx, fy = px - x0, py - y0
            for dy in range(1 - reach, 1 + reach):
                wy = _interpolation_weight(dy - fy, cubic)
                row = _wrap_or_clamp(y0 + dy, height, repeat)
                for dx in range(1 - reach, 1 + reach):
                    w = wy * _interpolation_weight(dx - fx, cubic)
                    k = start + row * width + _wrap_or_clamp(x0 + dx, width, repeat)
                    red += w * pixels[k, 0]
                    green += w * pixels[k, 1]
                    blue += w * pixels[k, 2]
    share = 1.0 / (m * n)
    out[0] = min(max(red * share + 0.5, 0.0), 255.0)
    out[1] = min(max(green * share + 0.5, 0.0), 255.0)
    out[2] = min(max(blue * share + 0.5, 0.0), 255.0)


@njit(cache=True, nogil=True)
def _wrap_or_clamp(index: int, size: int, repeat: bool) -> int:
    return index % size if repeat else min(max(index, 0), size - 1)


@njit(cache=True, nogil=True)
def _interpolation_weight(offset: float, cubic: bool) -> float:
    d = abs(offset)
    if not cubic:
        return 1.0 - d
    if d <= 1.0:
        return (1.5 * d - 2.5) * d * d + 1.0
    return ((2.5 - 0.5 * d) * d - 4.0) * d + 2.0
