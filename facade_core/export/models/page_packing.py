"""Packing of pieces of any outline on pages whose sides are powers of two.

A piece occupies the cells of its triangles, so that other pieces fit into its notches. First fit, row by row, largest first.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain, product

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, Int32Array, Int64Array, IntArray
from facade_core.core.numba_cache import njit
from facade_core.export.models.pages import PageLayout

# Side of a cell and width of a piece's border, texels: a block of ETC1S, and no mip level down to a quarter mixes two
# pieces. Below that, a coarser tile replaces this one.
CELL_TEXELS = 4
# Minimum side of a page, texels.
MIN_PAGE_TEXELS = 64
# Maximum side of a page, texels.
MAX_PAGE_TEXELS = 4096
# Expected share of a page that pieces with borders can fill; pages with less room are not tried.
MAX_FILL = 0.97
# Maximum number of pages of different sizes; each has at most half the area of the one before.
MAX_PAGES_TRIED = 4

# Width and height of pages in cells.
PageCells = tuple[tuple[int, int], ...]
# Sort key of a piece from its mask.
SortKey = Callable[[BoolArray], tuple[int, ...]]


def shrink_for_border(size: Int64Array) -> Int64Array:
    """Shrink sizes just enough that a side which fits a power of two still fits it with its border.

    Parameters
    ----------
    size : (n, 2) width and height in texels.

    Returns
    -------
    (n, 2) sizes.
    """
    side = 2 ** np.ceil(np.log2(np.maximum(size, 1))).astype(np.int64)
    fits = size + 2 * CELL_TEXELS <= side
    return np.where(fits | (side < 32 * CELL_TEXELS), size, np.minimum(size, side - 2 * CELL_TEXELS))


def rasterise_cells(triangles: Float64Array, size: tuple[int, int]) -> BoolArray:
    """Mark the cells that triangles cover, with a border of one cell.

    Parameters
    ----------
    triangles : (t, 3, 2) corners in texels of the raster.
    size : width and height of the raster in texels.

    Returns
    -------
    (rows, columns) bool; the raster starts at cell (1, 1), inside the border.
    """
    import cv2

    width, height = size
    shape = (-(-height // CELL_TEXELS) * CELL_TEXELS, -(-width // CELL_TEXELS) * CELL_TEXELS)
    drawn = np.zeros(shape, np.uint8)
    places = np.round((np.clip(triangles, 0, [width, height]) - 0.5) * 16).astype(np.int32)
    for triangle in places:
        cv2.fillConvexPoly(drawn, triangle, 1, lineType=cv2.LINE_8, shift=4)
    # coverage by pixel centres misses at most one texel
    whole = np.asarray(cv2.dilate(drawn, np.ones((3, 3), np.uint8)))
    cells = whole.reshape(shape[0] // CELL_TEXELS, CELL_TEXELS, shape[1] // CELL_TEXELS, CELL_TEXELS).any(axis=(1, 3))
    return cv2.dilate(np.pad(cells, 1).astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)


def pack_pages(masks: Sequence[BoolArray], size: Int64Array) -> PageLayout:
    """Pack pieces on pages with as few texels as first fit finds.

    Parameters
    ----------
    masks : cells of each piece with its border, from `rasterise_cells`.
    size : (n, 2) width and height of each piece in texels.

    Raises
    ------
    ValueError : a piece is larger than the largest page.
    """
    n = len(masks)
    need = sum(int(mask.sum()) for mask in masks)
    longest = np.array([mask.shape[::-1] for mask in masks]).reshape(-1, 2).max(axis=0, initial=1)
    measures: list[SortKey] = [
        lambda mask: (-max(mask.shape), -int(mask.sum())),
        lambda mask: (-int(mask.sum()),),
        lambda mask: (-mask.shape[0], -mask.shape[1]),
        lambda mask: (-mask.shape[1], -mask.shape[0]),
    ]
    orders = [_sort_pieces(masks, measure) for measure in measures]
    runs = [_find_runs(mask) for mask in masks]
    whole = (MAX_PAGE_TEXELS // CELL_TEXELS,) * 2
    more = ((whole,) * count for count in range(2, n + 1))
    for pages in chain(_candidate_pages(need, longest), more):
        tried = (_place_pieces(masks, runs, order, pages) for order in orders)
        if (found := next((one for one in tried if one is not None), None)) is not None:
            page, x, y = found
            # pieces may fill a page better than expected and leave another empty
            used, page = np.unique(page, return_inverse=True)
            sides = np.array(pages, np.int64).reshape(-1, 2)[used] * CELL_TEXELS
            return PageLayout(page, (x + 1) * CELL_TEXELS, (y + 1) * CELL_TEXELS, size, sides)
    raise ValueError(f"a piece is larger than a page of {MAX_PAGE_TEXELS} texels")


def _sort_pieces(masks: Sequence[BoolArray], measure: SortKey) -> list[int]:
    return sorted(range(len(masks)), key=lambda i: (*measure(masks[i]), i))


def _candidate_pages(need: int, longest: IntArray) -> list[PageCells]:
    """Return sets of pages (width, height) in cells by increasing area; the first page holds the longest piece."""
    if not need:
        return [()]
    low, high = (int(np.log2(side // CELL_TEXELS)) for side in (MIN_PAGE_TEXELS, MAX_PAGE_TEXELS))
    shapes = [(2**a, 2**b) for a, b in product(range(low, high + 1), repeat=2) if abs(a - b) <= 2]
    first = [shape for shape in shapes if shape[0] >= longest[0] and shape[1] >= longest[1]]
    found: list[PageCells] = [(shape,) for shape in first]
    others = [shape for shape in shapes if shape[0] >= shape[1]]
    for _ in range(MAX_PAGES_TRIED - 1):
        found += [
            (*pages, other)
            for pages in found
            for other in others
            if 2 * other[0] * other[1] <= pages[-1][0] * pages[-1][1]
        ]
    area = {pages: sum(w * h for w, h in pages) for pages in found}
    room = [pages for pages in area if area[pages] * MAX_FILL >= need]
    return sorted(room, key=lambda pages: (area[pages], len(pages), pages))


def _place_pieces(
    masks: Sequence[BoolArray],
    runs: Sequence[Int32Array],
    order: Sequence[int],
    pages: PageCells,
) -> tuple[Int64Array, Int64Array, Int64Array] | None:
    """Return page, column and row (n,) of every piece; None if they do not fit."""
    place = [np.zeros(len(masks), np.int64) for _ in range(3)]
    left = list(order)
    for number, (width, height) in enumerate(pages):
        taken = np.full(
            (height, width + 1), width, np.int32
        )  # next taken cell of each row; the end of the page after the last
        end = np.zeros((height, width + 1), np.int32)
        over = []
        for i in left:
            rows, columns = masks[i].shape
            x, y = _first_fit(taken, end, runs[i], columns, rows) if columns <= width and rows <= height else (-1, -1)
            if x < 0:
                over.append(i)
                continue
            place[0][i], place[1][i], place[2][i] = number, x, y
        left = over
    return None if left else (place[0], place[1], place[2])


def _find_runs(mask: BoolArray) -> Int32Array:
    """Return the runs (r, 3) of set cells of a mask: row, first column, end column."""
    edges = np.diff(np.pad(mask, [(0, 0), (1, 1)]).astype(np.int8), axis=1)
    row, start = np.nonzero(edges == 1)
    _, stop = np.nonzero(edges == -1)
    return np.column_stack([row, start, stop]).astype(np.int32)


@njit(cache=True, nogil=True)
def _first_fit(taken: Int32Array, end: Int32Array, runs: Int32Array, columns: int, rows: int) -> tuple[int, int]:
    """Find the first position by rows, then columns, mark its cells and return (x, y); (-1, -1) if there is none.

    Parameters
    ----------
    taken : taken[y, x] is the first taken cell of row y at or after x.
    end : end[y, x] of a taken cell is the end of its run.
    """
    height, width = taken.shape[0], taken.shape[1] - 1
    for y in range(height - rows + 1):
        x = 0
        while x + columns <= width:
            moved = False
            for k in range(len(runs)):
                row = y + runs[k, 0]
                hit = taken[row, x + runs[k, 1]]
                if hit < x + runs[k, 2]:
                    x = end[row, hit] - runs[k, 1]
                    moved = True
                    break
            if not moved:
                for k in range(len(runs)):
                    _mark_run(taken, end, y + runs[k, 0], x + runs[k, 1], x + runs[k, 2])
                return x, y
    return -1, -1


@njit(cache=True, nogil=True)
def _mark_run(taken: Int32Array, end: Int32Array, row: int, start: int, stop: int) -> None:
    width = taken.shape[1] - 1
    until = stop
    if stop < width and taken[row, stop] == stop:
        until = end[row, stop]
    first = start
    while first > 0 and taken[row, first - 1] == first - 1:
        first -= 1
    for x in range(start, stop):
        taken[row, x] = x
    for x in range(first, stop):
        end[row, x] = until
    x = start - 1
    while x >= 0 and taken[row, x] >= start:
        taken[row, x] = start
        x -= 1
