"""Render a tiling: tiles are warped into their cells, and borders move to where neighbours agree.

Detail changes from one tile to the next along a path of least difference, up to `max_seam_shift_px` off the cell's
border. The colour of the wall cross-fades over the border; elements stay whole, in its light.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from facade_core.core.arrays import Float32Array, Float64Array, Int32Array, Int64Array, UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.core.numba_cache import njit
from facade_core.core.types import Lattice
from facade_core.facade.texture.seams import find_min_error_path
from facade_core.facade.texture.settings import SYNTHESIS
from facade_core.facade.wall_material import wall_colour_field

# Cost of each pixel by which a path cuts off or adds to an element, beyond any difference of colour: no path does.
_LABEL_COST = 1e12


def compose_tiles(
    image: UInt8Array,
    labels: UInt8Array,
    lattice: Lattice,
    tiles: Int32Array,
    rows: Int64Array,
    columns: Int64Array,
    reduction: float = 1.0,
) -> tuple[UInt8Array, UInt8Array]:
    """Render tiles into cells.

    Neighbours in the exemplar show the same pixels on both sides of a border, so only true jumps are seams. Labels
    use nearest-neighbour sampling.

    Parameters
    ----------
    image : (H, W, 3) uint8 exemplar.
    labels : (H, W) uint8 class ids.
    lattice : lattice of the exemplar.
    tiles : (M, N) tile numbers.
    rows : (M + 1,) borders of cells.
    columns : (N + 1,) borders of cells.
    reduction : exemplar pixels for each pixel of the result.

    Returns
    -------
    Image and labels.
    """
    source_rows, source_columns = np.asarray(lattice.rows, np.float64), np.asarray(lattice.columns, np.float64)
    rows, columns = np.asarray(rows, np.int64), np.asarray(columns, np.int64)
    full_rows, full_columns = source_rows, source_columns
    across = len(source_columns) - 1
    shrink_y = _typical_scale(np.diff(rows)[:, None], np.diff(source_rows)[tiles // across])
    shrink_x = _typical_scale(np.diff(columns)[None, :], np.diff(source_columns)[tiles % across])
    wall = (labels == FacadeClass.WALL).astype(np.float32)
    if min(shrink_y, shrink_x) < 0.95:  # area filtering first, so that the bilinear warp works near scale 1
        height, width = image.shape[:2]
        small = max(4, round(height * min(1.0, shrink_y))), max(4, round(width * min(1.0, shrink_x)))
        image = np.asarray(cv2.resize(image, small[::-1], interpolation=cv2.INTER_AREA), image.dtype)
        wall = np.asarray(cv2.resize(wall, small[::-1], interpolation=cv2.INTER_AREA), np.float32)
        source_rows, source_columns = source_rows * small[0] / height, source_columns * small[1] / width
    colour = image.astype(np.float32)
    where = (source_rows, source_columns, tiles, rows, columns)
    reach = max(1, round(SYNTHESIS.max_seam_shift_px / reduction))
    right_start, lower_start = _find_seam_paths(colour, labels, *where, full_rows, full_columns, reach)
    cell = _assign_cells(right_start, lower_start, rows, columns)
    low = wall_colour_field(colour, wall, SYNTHESIS.band_sigma_px / reduction)
    out = _render_faded(low, *where, max(1, round(SYNTHESIS.fade_px / reduction))) + _render_cells(
        colour - low, cell, *where
    )
    fine = _render_labels(labels, cell, full_rows, full_columns, tiles, rows, columns)
    return np.clip(np.rint(out), 0, 255).astype(np.uint8), fine


def _typical_scale(sizes: Int64Array, source_sizes: Float64Array) -> float:
    """Return the median scale of cells (M, N) by their pixels along an axis: slivers do not count."""
    sizes = np.broadcast_to(sizes, source_sizes.shape).ravel()
    return float(np.median(np.repeat(sizes / source_sizes.ravel(), sizes)))


@njit(cache=True)
def _exemplar_position(position: int, cell: int, source: Float64Array, borders: Int64Array, tile: int) -> float:
    """Return the exemplar position, along one axis, of a position that a cell shows.

    A tile that would be stretched more than threefold is repeated, every second time mirrored; a narrow one would show stripes.
    """
    size, wide = source[tile + 1] - source[tile], max(1, borders[cell + 1] - borders[cell])
    share = (position - borders[cell] + 0.5) / wide
    if wide > 3 * size and size >= 8:
        share *= round(wide / size)
        share = abs(share - 2 * math.floor((share + 1) / 2))
    exemplar_position: float = source[tile] + share * size
    return exemplar_position


@njit(cache=True)
def _find_neighbours(position: float, size: int) -> tuple[int, np.float32]:
    """Return the first of the two pixels of an axis beside a position counted from its start, and the second one's share."""
    position = min(max(position - 0.5, 0.0), size - 1.0)
    first = min(int(position), size - 2)
    return first, np.float32(position - first)


@njit(cache=True)
def _sample_bilinear(
    image: Float32Array, top: int, fv: np.float32, left: int, fu: np.float32, out: Float32Array
) -> None:
    """Sample bilinearly between pixels and their shares, as of `_find_neighbours`."""
    for c in range(3):
        upper = image[top, left, c] * (1 - fu) + image[top, left + 1, c] * fu
        lower = image[top + 1, left, c] * (1 - fu) + image[top + 1, left + 1, c] * fu
        out[c] = upper * (1 - fv) + lower * fv


@njit(cache=True)
def _place_along(
    start: int, stop: int, cell: int, source: Float64Array, borders: Int64Array, tile: int, size: int
) -> tuple[Int64Array, Float32Array, Int64Array]:
    """Return `_find_neighbours` and the pixels of the positions from `start` to `stop` that a cell shows along an axis."""
    first, share, pixel = (
        np.empty(stop - start, np.int64),
        np.empty(stop - start, np.float32),
        np.empty(stop - start, np.int64),
    )
    for k in range(stop - start):
        position = _exemplar_position(start + k, cell, source, borders, tile)
        first[k], share[k] = _find_neighbours(position, size)
        pixel[k] = min(max(int(position), 0), size - 1)
    return first, share, pixel


@njit(cache=True)
def _find_seam_paths(
    image: Float32Array,
    labels: UInt8Array,
    source_rows: Float64Array,
    source_columns: Float64Array,
    tiles: Int32Array,
    rows: Int64Array,
    columns: Int64Array,
    label_rows: Float64Array,
    label_columns: Float64Array,
    most: int,
) -> tuple[Int64Array, Int64Array]:
    """Return the first column, (H, N - 1), and the first row, (M - 1, W), that the next cell shows.

    A path keeps to the border where the cells show other classes than each other: it would cut an element, or add a sliver.
    """
    tall, wide = tiles.shape
    high, broad = image.shape[0], image.shape[1]
    across = len(source_columns) - 1
    right_start = np.empty((rows[-1], max(0, wide - 1)), np.int64)
    lower_start = np.empty((max(0, tall - 1), columns[-1]), np.int64)
    one, other = np.empty(3, np.float32), np.empty(3, np.float32)
    for m in range(tall):
        for n in range(wide):
            y0, y1, x0, x1 = rows[m], rows[m + 1], columns[n], columns[n + 1]
            i, j = tiles[m, n] // across, tiles[m, n] % across
            for side in range(2):
                if (n + 1 == wide) if side == 0 else (m + 1 == tall):
                    continue
                mm, nn = (m, n + 1) if side == 0 else (m + 1, n)
                ii, jj = tiles[mm, nn] // across, tiles[mm, nn] % across
                length = y1 - y0 if side == 0 else x1 - x0
                limit = (min(x1 - x0, columns[nn + 1] - x1) if side == 0 else min(y1 - y0, rows[mm + 1] - y1)) // 2
                reach = min(most, limit)
                error = np.empty((length, 2 * reach + 1))
                differs = np.empty(2 * reach + 1, np.bool_)
                top, foot = (y0, y1) if side == 0 else (y1 - reach, y1 + reach + 1)
                left, right = (x1 - reach, x1 + reach + 1) if side == 0 else (x0, x1)
                own_row, own_fv, _ = _place_along(top, foot, m, source_rows, rows, i, high)
                own_column, own_fu, _ = _place_along(left, right, n, source_columns, columns, j, broad)
                row, fv, _ = _place_along(top, foot, mm, source_rows, rows, ii, high)
                column, fu, _ = _place_along(left, right, nn, source_columns, columns, jj, broad)
                own_v = _place_along(top, foot, m, label_rows, rows, i, labels.shape[0])[2]
                own_u = _place_along(left, right, n, label_columns, columns, j, labels.shape[1])[2]
                v = _place_along(top, foot, mm, label_rows, rows, ii, labels.shape[0])[2]
                u = _place_along(left, right, nn, label_columns, columns, jj, labels.shape[1])[2]
                for a in range(length):
                    for b in range(2 * reach + 1):
                        y, x = (a, b) if side == 0 else (b, a)
                        _sample_bilinear(image, own_row[y], own_fv[y], own_column[x], own_fu[x], one)
                        _sample_bilinear(image, row[y], fv[y], column[x], fu[x], other)
                        error[a, b] = 0.01 * abs(b - reach)
                        for c in range(3):
                            error[a, b] += (one[c] - other[c]) ** 2
                        differs[b] = labels[own_v[y], own_u[x]] != labels[v[y], u[x]]
                    for way in (-1, 1):
                        passed = 0
                        for step in range(1, reach + 1):
                            passed += differs[reach + way * step - (way + 1) // 2]
                            for _ in range(passed):
                                error[a, reach + way * step] += _LABEL_COST
                path = find_min_error_path(error)
                for a in range(length):
                    if side == 0:
                        right_start[y0 + a, n] = x1 - reach + path[a]
                    else:
                        lower_start[m, x0 + a] = y1 - reach + path[a]
    return right_start, lower_start


@njit(cache=True)
def _assign_cells(
    right_start: Int64Array, lower_start: Int64Array, rows: Int64Array, columns: Int64Array
) -> Int32Array:
    """Return the cell that every pixel shows, (H, W) int32: m * N + n."""
    height, width, wide = rows[-1], columns[-1], right_start.shape[1] + 1
    cell = np.empty((height, width), np.int32)
    column = np.empty((height, width), np.int32)
    for y in range(height):
        n = 0
        for x in range(width):
            while n < wide - 1 and x >= right_start[y, n]:
                n += 1
            column[y, x] = n
    for x in range(width):
        m = 0
        for y in range(height):
            while m < lower_start.shape[0] and y >= lower_start[m, x]:
                m += 1
            cell[y, x] = m * wide + column[y, x]
    return cell


@njit(cache=True)
def _render_cells(
    image: Float32Array,
    cell: Int32Array,
    source_rows: Float64Array,
    source_columns: Float64Array,
    tiles: Int32Array,
    rows: Int64Array,
    columns: Int64Array,
) -> Float32Array:
    """Render each pixel as its cell shows it, (H, W, 3) float32."""
    height, width, wide = cell.shape[0], cell.shape[1], tiles.shape[1]
    across = len(source_columns) - 1
    out = np.empty((height, width, 3), np.float32)
    for y in range(height):
        shown = -1
        n, j, top, fv = 0, 0, 0, np.float32(0)
        for x in range(width):
            if cell[y, x] != shown:
                shown = cell[y, x]
                m, n = shown // wide, shown % wide
                i, j = tiles[m, n] // across, tiles[m, n] % across
                top, fv = _find_neighbours(_exemplar_position(y, m, source_rows, rows, i), image.shape[0])
            left, fu = _find_neighbours(_exemplar_position(x, n, source_columns, columns, j), image.shape[1])
            _sample_bilinear(image, top, fv, left, fu, out[y, x])
    return out


@njit(cache=True)
def _render_labels(
    labels: UInt8Array,
    cell: Int32Array,
    source_rows: Float64Array,
    source_columns: Float64Array,
    tiles: Int32Array,
    rows: Int64Array,
    columns: Int64Array,
) -> UInt8Array:
    wide, across = tiles.shape[1], len(source_columns) - 1
    out = np.empty(cell.shape, np.uint8)
    for y in range(cell.shape[0]):
        shown = -1
        n, j, v = 0, 0, 0
        for x in range(cell.shape[1]):
            if cell[y, x] != shown:
                shown = cell[y, x]
                m, n = shown // wide, shown % wide
                i, j = tiles[m, n] // across, tiles[m, n] % across
                v = min(max(int(_exemplar_position(y, m, source_rows, rows, i)), 0), labels.shape[0] - 1)
            u = min(max(int(_exemplar_position(x, n, source_columns, columns, j)), 0), labels.shape[1] - 1)
            out[y, x] = labels[v, u]
    return out


@njit(cache=True)
def _render_faded(
    image: Float32Array,
    source_rows: Float64Array,
    source_columns: Float64Array,
    tiles: Int32Array,
    rows: Int64Array,
    columns: Int64Array,
    margin: int,
) -> Float32Array:
    """Accumulate every tile, extended by margin, with weights that fade over the border."""
    height, width = rows[-1], columns[-1]
    out = np.zeros((height, width, 3), np.float32)
    weight = np.zeros((height, width), np.float32)
    across = len(source_columns) - 1
    one = np.empty(3, np.float32)
    fades = np.empty(width)
    for m in range(tiles.shape[0]):
        for n in range(tiles.shape[1]):
            i, j = tiles[m, n] // across, tiles[m, n] % across
            y0, y1, x0, x1 = rows[m], rows[m + 1], columns[n], columns[n + 1]
            if y1 == y0 or x1 == x0:
                continue
            start, stop = max(0, x0 - margin), min(width, x1 + margin)
            lefts, shares, _ = _place_along(start, stop, n, source_columns, columns, j, image.shape[1])
            for x in range(start, stop):
                fades[x] = _fade(x, x0, x1, margin)
            for y in range(max(0, y0 - margin), min(height, y1 + margin)):
                fade_y = _fade(y, y0, y1, margin)
                top, fv = _find_neighbours(_exemplar_position(y, m, source_rows, rows, i), image.shape[0])
                for x in range(start, stop):
                    _sample_bilinear(image, top, fv, lefts[x - start], shares[x - start], one)
                    w = np.float32(fade_y * fades[x])
                    weight[y, x] += w
                    for c in range(3):
                        out[y, x, c] += w * one[c]
    for y in range(height):
        for x in range(width):
            for c in range(3):
                out[y, x, c] /= weight[y, x]
    return out


@njit(cache=True)
def _fade(position: int, start: int, stop: int, margin: int) -> float:
    """Return the weight of a cell at a position along an axis: 1 inside, less within `margin` of its borders."""
    return min(
        1.0, (position - start + 0.5 + margin) / (2.0 * margin), (stop - position - 0.5 + margin) / (2.0 * margin)
    )
