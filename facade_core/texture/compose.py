"""From a tiling to pixels: tiles are warped into their cells and blended across cells in two frequency bands."""

from __future__ import annotations

import cv2
import numpy as np
from numba import njit

from facade_core.types import Lattice

_SIGMA = 6.0  # px, splits colour (low band) from detail (high band)
_WIDE, _NARROW = 10, 2  # px on either side of a cell border over which the two bands cross-fade


def compose(
    image: np.ndarray, labels: np.ndarray, lattice: Lattice, tiles: np.ndarray, rows: np.ndarray, columns: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Render tiles (M, N) of image (H, W, 3) into cells with borders rows (M + 1,), columns (N + 1,): image, labels.

    Where two neighbours are also neighbours in the exemplar both sides of a cross-fade show the same pixels, so only
    true jumps are blended. Labels are carried along with nearest-neighbour sampling.
    """
    source_rows, source_columns = np.asarray(lattice.rows, np.float64), np.asarray(lattice.columns, np.float64)
    rows, columns = np.asarray(rows, np.int64), np.asarray(columns, np.int64)
    fine = _carry(labels, source_rows, source_columns, tiles, rows, columns)
    across = len(source_columns) - 1
    shrink_y = np.median(np.diff(rows)[:, None] / np.diff(source_rows)[tiles // across])
    shrink_x = np.median(np.diff(columns)[None, :] / np.diff(source_columns)[tiles % across])
    if min(shrink_y, shrink_x) < 0.95:  # area filtering first, so that the bilinear warp works near scale 1
        height, width = image.shape[:2]
        small = max(4, round(height * min(1.0, shrink_y))), max(4, round(width * min(1.0, shrink_x)))
        image = cv2.resize(image, small[::-1], interpolation=cv2.INTER_AREA)
        source_rows, source_columns = source_rows * small[0] / height, source_columns * small[1] / width
    colour = image.astype(np.float32)
    low = cv2.GaussianBlur(colour, (0, 0), _SIGMA, borderType=cv2.BORDER_REPLICATE)
    where = (source_rows, source_columns, tiles, rows, columns)
    out = _splat(low, *where, _WIDE) + _splat(colour - low, *where, _NARROW)
    return np.clip(np.rint(out), 0, 255).astype(np.uint8), fine


@njit(cache=True)
def _carry(labels, source_rows, source_columns, tiles, rows, columns):
    out = np.empty((rows[-1], columns[-1]), np.uint8)
    across = len(source_columns) - 1
    for m in range(tiles.shape[0]):
        for n in range(tiles.shape[1]):
            i, j = tiles[m, n] // across, tiles[m, n] % across
            step_y = (source_rows[i + 1] - source_rows[i]) / max(1, rows[m + 1] - rows[m])
            step_x = (source_columns[j + 1] - source_columns[j]) / max(1, columns[n + 1] - columns[n])
            for y in range(rows[m], rows[m + 1]):
                v = int(source_rows[i] + (y - rows[m] + 0.5) * step_y)
                for x in range(columns[n], columns[n + 1]):
                    out[y, x] = labels[v, int(source_columns[j] + (x - columns[n] + 0.5) * step_x)]
    return out


@njit(cache=True)
def _splat(image, source_rows, source_columns, tiles, rows, columns, margin):
    """Accumulate every tile, extended by margin into its surroundings, with weights that fade over the border."""
    height, width = rows[-1], columns[-1]
    out = np.zeros((height, width, 3), np.float32)
    weight = np.zeros((height, width), np.float32)
    across = len(source_columns) - 1
    for m in range(tiles.shape[0]):
        for n in range(tiles.shape[1]):
            i, j = tiles[m, n] // across, tiles[m, n] % across
            y0, y1, x0, x1 = rows[m], rows[m + 1], columns[n], columns[n + 1]
            if y1 == y0 or x1 == x0:
                continue
            step_y = (source_rows[i + 1] - source_rows[i]) / (y1 - y0)
            step_x = (source_columns[j + 1] - source_columns[j]) / (x1 - x0)
            for y in range(max(0, y0 - margin), min(height, y1 + margin)):
                fade_y = min(1.0, (y - y0 + 0.5 + margin) / (2.0 * margin), (y1 - y - 0.5 + margin) / (2.0 * margin))
                v = min(max(source_rows[i] + (y - y0 + 0.5) * step_y - 0.5, 0.0), image.shape[0] - 1.0)
                top = min(int(v), image.shape[0] - 2)
                fv = np.float32(v - top)
                for x in range(max(0, x0 - margin), min(width, x1 + margin)):
                    fade_x = min(
                        1.0, (x - x0 + 0.5 + margin) / (2.0 * margin), (x1 - x - 0.5 + margin) / (2.0 * margin)
                    )
                    u = min(max(source_columns[j] + (x - x0 + 0.5) * step_x - 0.5, 0.0), image.shape[1] - 1.0)
                    left = min(int(u), image.shape[1] - 2)
                    fu = np.float32(u - left)
                    w = np.float32(fade_y * fade_x)
                    weight[y, x] += w
                    for c in range(3):
                        upper = image[top, left, c] * (1 - fu) + image[top, left + 1, c] * fu
                        lower = image[top + 1, left, c] * (1 - fu) + image[top + 1, left + 1, c] * fu
                        out[y, x, c] += w * (upper * (1 - fv) + lower * fv)
    for y in range(height):
        for x in range(width):
            for c in range(3):
                out[y, x, c] /= weight[y, x]
    return out
