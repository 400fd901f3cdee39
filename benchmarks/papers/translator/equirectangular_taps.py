"""Taps of an equirectangular convolution kernel (street paper, 3 Neural network)."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from facade_core.core.arrays import Float32Array
from facade_core.core.numba_cache import njit

# Side of the kernel, pixels.
KERNEL_SIZE = 7
TAP_COUNT = KERNEL_SIZE * KERNEL_SIZE


@lru_cache(maxsize=8)
def kernel_taps(height: int) -> tuple[Float32Array, Float32Array]:
    """Return rows and column offsets (height, TAP_COUNT) float32 of the kernel's taps, in pixels.

    The kernel is a patch of the sphere: pixels around a place at the equator, moved along the meridian to the row's
    latitude. Rows count from the middle of the first one, in -0.5 .. height - 0.5. A column offset beyond a quarter of
    the width is a tap on the far side of a pole.
    """
    step = np.pi / height
    latitude = (0.5 - (np.arange(height) + 0.5) / height)[:, None, None] * np.pi
    place = (np.arange(KERNEL_SIZE) - KERNEL_SIZE // 2) * step
    down, right = place[None, :, None], place[None, None, :]
    x = np.cos(down) * np.sin(right)
    y, z = -np.sin(down), np.cos(down) * np.cos(right)
    up = y * np.cos(latitude) + z * np.sin(latitude)
    ahead = z * np.cos(latitude) - y * np.sin(latitude)
    rows = (0.5 - np.arcsin(np.clip(up, -1, 1)) / np.pi) * height - 0.5
    columns = np.arctan2(np.broadcast_to(x, up.shape), ahead) / step
    return rows.reshape(height, TAP_COUNT).astype(np.float32), columns.reshape(height, TAP_COUNT).astype(np.float32)


def gather_taps(image: Float32Array, rows: tuple[int, int]) -> Float32Array:
    """Gather the taps of some rows of a whole panorama, bilinearly.

    Parameters
    ----------
    image : (bands, h, 2 h) float32.
    rows : first and last + 1.

    Returns
    -------
    (bands * TAP_COUNT, rows, columns) float32.
    """
    tap_rows, tap_columns = kernel_taps(image.shape[1])
    out = np.empty((len(image) * TAP_COUNT, rows[1] - rows[0], image.shape[2]), np.float32)
    _gather_rows(image, tap_rows[slice(*rows)], tap_columns[slice(*rows)], out)
    return out


@njit(cache=True, nogil=True)
def _gather_rows(image: Float32Array, rows: Float32Array, columns: Float32Array, out: Float32Array) -> None:
    bands, height, width = image.shape
    count = out.shape[2]
    line = np.empty(count + 1, np.float32)
    for r in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            above = int(np.floor(rows[r, k]))
            below = np.float32(rows[r, k] - above)
            first, second = max(above, 0), min(above + 1, height - 1)
            whole = int(np.floor(columns[r, k]))
            right = np.float32(columns[r, k] - whole)
            start = whole % width
            for band in range(bands):
                upper, lower = image[band, first], image[band, second]
                for c in range(min(count + 1, width - start)):
                    line[c] = upper[start + c] + (lower[start + c] - upper[start + c]) * below
                for c in range(width - start, count + 1):  # around at +-180 degrees
                    line[c] = upper[start + c - width] + (lower[start + c - width] - upper[start + c - width]) * below
                target = out[band * TAP_COUNT + k, r]
                for c in range(count):
                    target[c] = line[c] + (line[c + 1] - line[c]) * right
