"""Bilateral grid of affine colour transforms (Gharbi et al. 2017), applied to a panorama of any size."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Float32Array, UInt8Array
from facade_core.core.numba_cache import njit

# Height of the panorama that the network sees, and what a training image is reduced by to that size.
NETWORK_HEIGHT = 256
REDUCTION = 2
BRIGHTNESS_BINS = 8
# Rows of a panorama that training shows, as shares of its height: others show the zenith, and below the car of a survey or a
# banner. The lowest row shows ground at 3.4 m from a camera at 2.5 m.
TRAINED_ROWS = (0.1, 0.7)
# Entries of a 3 x 4 matrix.
COEFFICIENTS = 12


def apply_colour_grid(grid: Float32Array, image: UInt8Array) -> UInt8Array:
    """Apply a grid of transforms to a whole panorama.

    The transform of a pixel is interpolated between the cells around its place and brightness. Columns wrap at +-180 degrees.

    Parameters
    ----------
    grid : (COEFFICIENTS, BRIGHTNESS_BINS, rows, columns) float32, matrices of colours in -1..1.
    image : (h, w, 3) uint8.

    Returns
    -------
    (h, w, 3) uint8.
    """
    cells = np.ascontiguousarray(grid.transpose(2, 3, 1, 0))
    out = np.empty_like(image)
    _transform_pixels(cells, np.ascontiguousarray(image), out)
    return out


@njit(cache=True, nogil=True)
def _transform_pixels(cells: Float32Array, image: UInt8Array, out: UInt8Array) -> None:
    rows, columns, bins, coefficients = cells.shape
    height, width = image.shape[:2]
    # matrices of a row of the panorama, between two rows of cells
    line = np.empty((columns, bins, coefficients), np.float32)
    matrix = np.empty(coefficients, np.float32)
    colour = np.empty(3, np.float32)
    for i in range(height):
        row_at = min(max((i + 0.5) * rows / height - 0.5, 0.0), rows - 1.0)
        above = min(int(row_at), rows - 2)
        below = np.float32(row_at - above)
        for c in range(columns):
            for b in range(bins):
                for k in range(coefficients):
                    upper = cells[above, c, b, k]
                    line[c, b, k] = upper + (cells[above + 1, c, b, k] - upper) * below
        for j in range(width):
            column_at = (j + 0.5) * columns / width - 0.5
            first = int(np.floor(column_at))
            right = np.float32(column_at - first)
            left_cell, right_cell = first % columns, (first + 1) % columns
            for band in range(3):
                colour[band] = image[i, j, band] * np.float32(1 / 127.5) - np.float32(1)
            brightness = np.float32(0.299) * colour[0] + np.float32(0.587) * colour[1] + np.float32(0.114) * colour[2]
            bin_at = min(max((brightness + 1) * 0.5 * bins - 0.5, 0.0), bins - 1.0)
            darker = min(int(bin_at), bins - 2)
            share = np.float32(bin_at - darker)
            for k in range(coefficients):
                dark = line[left_cell, darker, k]
                dark += (line[right_cell, darker, k] - dark) * right
                bright = line[left_cell, darker + 1, k]
                bright += (line[right_cell, darker + 1, k] - bright) * right
                matrix[k] = dark + (bright - dark) * share
            for band in range(3):
                value = matrix[4 * band + 3]
                for other in range(3):
                    value += matrix[4 * band + other] * colour[other]
                out[i, j, band] = np.uint8(min(max((value + 1) * 127.5 + 0.5, 0.0), 255.0))
