"""Packing of charts into atlas pages. Charts start at chunk boundaries, so that each chunk has one owner."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, Int32Array, Int64Array, UInt64Array
from facade_core.core.errors import GeometryError
from facade_core.core.numba_cache import njit
from facade_core.geometry.charts import raster_sizes
from facade_core.geometry.settings import PACKING

# Charts wider than half a chunk share chunks where they are at most chunk / THIN_DIVISOR texels high.
THIN_DIVISOR = 4


@dataclass(frozen=True)
class ChartPlacements:
    """Places of all n charts in the atlas; rows and columns are half-open.

    Attributes
    ----------
    page : (n,).
    x, y : (n,) first texel inside the gutter.
    width, height : (n,) texels.
    texels_per_metre : (n,) density of each chart.
    pages : number of pages.
    """

    page: Int32Array
    x: Int32Array
    y: Int32Array
    width: Int32Array
    height: Int32Array
    texels_per_metre: Float64Array
    pages: int

    def shape(self, chart: int) -> tuple[int, int]:
        """Return the numbers of rows and columns of a chart."""
        return int(self.height[chart]), int(self.width[chart])

    def region(self, chart: int) -> tuple[int, slice, slice]:
        """Return page, rows and columns of a chart's texels: an index of the atlas arrays."""
        (height, width), y, x = self.shape(chart), int(self.y[chart]), int(self.x[chart])
        return int(self.page[chart]), slice(y, y + height), slice(x, x + width)

    def chunks(self, chart: int, chunk: int, gutter: int) -> Int32Array:
        """Return the chunks that hold a chart's texels and gutters.

        Parameters
        ----------
        chart : index of the chart.
        chunk : side of a chunk in texels.
        gutter : texels.

        Returns
        -------
        (k, 3) page, chunk row, chunk column.
        """
        rows = np.arange(
            (self.y[chart] - gutter) // chunk, (self.y[chart] + self.height[chart] + gutter - 1) // chunk + 1
        )
        columns = np.arange(
            (self.x[chart] - gutter) // chunk, (self.x[chart] + self.width[chart] + gutter - 1) // chunk + 1
        )
        grid = np.stack(np.meshgrid(rows, columns, indexing="ij"), axis=-1).reshape(-1, 2)
        return np.column_stack([np.full(len(grid), self.page[chart]), grid]).astype(np.int32)


@dataclass(frozen=True)
class PreviousChartPlacements:
    """Placement of an earlier ingest, with its chart ids (n,) as computed by `facade_core.plan.identity`."""

    ids: UInt64Array
    placement: ChartPlacements


def pack_charts(
    size: Float64Array,
    texels_per_metre: float | Float64Array,
    owner: Int32Array,
    *,
    page: int,
    chunk: int,
    gutter: int,
    ids: UInt64Array | None = None,
    previous: PreviousChartPlacements | None = None,
) -> ChartPlacements:
    """Pack charts into square pages, first fit in their order over the last few pages.

    Charts up to half a chunk share chunks with charts of the same owner, and so do long charts up to chunk /
    THIN_DIVISOR high. With an earlier placement, known charts keep their places, and new ones take the first free
    places.

    Parameters
    ----------
    size : (n, 2) width and height in metres.
    texels_per_metre : one density, or (n,).
    owner : (n,) building of each chart; -1 never shares a chunk.
    page : side of a page in texels.
    chunk : side of a chunk in texels.
    gutter : texels around each chart.
    ids : (n,) chart ids, needed with `previous`.
    previous : placement of an earlier ingest.

    Raises
    ------
    GeometryError Where a chart is larger than a page without its gutters.
    """
    texels = raster_sizes(size, texels_per_metre)
    outer = texels + 2 * gutter
    if len(outer) and outer.max() > page:
        largest = int(np.argmax(outer.max(axis=1)))
        raise GeometryError(
            f"chart {largest} needs {outer[largest].max()} texels and a page has {page}; cut it or lower texels_per_metre"
        )
    block, inner_x, inner_y, blocks = _share_chunks(outer, np.asarray(owner, np.int64), chunk)
    cells = np.ones((blocks, 2), np.int64)
    large = (outer > chunk // 2).any(axis=1)
    np.maximum.at(cells, block[large], -(-outer[large] // chunk))
    place = np.full((blocks, 3), -1, np.int64)
    if previous is not None and ids is not None:
        corner = np.column_stack([inner_x, inner_y]) + gutter
        place = _reuse_places(place, block, corner, texels, ids, previous, chunk)
    _first_fit(
        place,
        cells,
        page // chunk,
        PACKING.max_open_pages if previous is None else blocks + int(place[:, 0].max(initial=0)) + 1,
    )
    return ChartPlacements(
        page=place[block, 0].astype(np.int32),
        x=(place[block, 1] * chunk + inner_x + gutter).astype(np.int32),
        y=(place[block, 2] * chunk + inner_y + gutter).astype(np.int32),
        width=texels[:, 0].astype(np.int32),
        height=texels[:, 1].astype(np.int32),
        texels_per_metre=np.broadcast_to(np.asarray(texels_per_metre, np.float64), len(texels)).copy(),
        pages=int(place[:, 0].max(initial=-1)) + 1,
    )


def has_own_chunks(outer: Int64Array, chunk: int) -> BoolArray:
    """Return a mask (n,) of the charts of buildings that share no chunk with others.

    Parameters
    ----------
    outer : (n, 2) width and height in texels with their gutters.
    chunk : side of a chunk in texels.
    """
    is_wide = outer[:, 0] > chunk // 2
    has_own: BoolArray = np.where(is_wide, outer[:, 1] > chunk // THIN_DIVISOR, outer[:, 1] > chunk // 2)
    return has_own


def _reuse_places(
    place: Int64Array,
    block: Int64Array,
    corner: Int64Array,
    texels: Int64Array,
    ids: UInt64Array,
    last: PreviousChartPlacements,
    chunk: int,
) -> Int64Array:
    """Fill `place` (blocks, 3) with page, column and row of each block whose charts all keep their earlier places."""
    if len(last.ids) == 0:
        return place
    order = np.argsort(last.ids)
    at = order[np.searchsorted(last.ids, ids, sorter=order).clip(max=len(order) - 1)]
    held = last.placement
    column, row = held.x[at] - corner[:, 0], held.y[at] - corner[:, 1]
    fits = (last.ids[at] == ids) & (held.width[at] == texels[:, 0]) & (held.height[at] == texels[:, 1])
    fits &= (column % chunk == 0) & (row % chunk == 0)
    found = np.column_stack([held.page[at], column // chunk, row // chunk]).astype(np.int64)
    first = np.unique(block, return_index=True)[1]
    fits &= (found == found[first][block]).all(axis=1)
    whole = np.ones(len(place), bool)
    np.logical_and.at(whole, block, fits)
    return np.where(whole[:, None], found[first], place)


@njit(cache=True)
def _share_chunks(outer: Int64Array, owner: Int64Array, chunk: int) -> tuple[Int64Array, Int64Array, Int64Array, int]:
    """Assign each chart to a block of whole chunks and a place in it; small and thin charts of one owner share shelves."""
    n = len(outer)
    block = np.empty(n, np.int64)
    inner_x = np.zeros(n, np.int64)
    inner_y = np.zeros(n, np.int64)
    blocks = 0
    shelf_owner, shelf_block, x, y, shelf_height = -1, -1, 0, 0, 0
    thin_owner, thin_block, thin_x, thin_y, thin_height, thin_length = -1, -1, 0, 0, 0, 0
    for i in range(n):
        width, height = outer[i, 0], outer[i, 1]
        if width > chunk // 2 and height <= chunk // THIN_DIVISOR and owner[i] >= 0:
            if owner[i] == thin_owner and thin_x + width > thin_length:
                thin_x, thin_y, thin_height = 0, thin_y + thin_height, 0
            if owner[i] != thin_owner or thin_y + height > chunk or width > thin_length:
                thin_owner, thin_block, thin_x, thin_y, thin_height = owner[i], blocks, 0, 0, 0
                thin_length = -(-width // chunk) * chunk
                blocks += 1
            block[i], inner_x[i], inner_y[i] = thin_block, thin_x, thin_y
            thin_x += width
            thin_height = max(thin_height, height)
            continue
        if width > chunk // 2 or height > chunk // 2 or owner[i] < 0:
            block[i] = blocks
            blocks += 1
            continue
        if owner[i] == shelf_owner and x + width > chunk:
            x, y, shelf_height = 0, y + shelf_height, 0
        if owner[i] != shelf_owner or y + height > chunk:
            shelf_owner, shelf_block, x, y, shelf_height = owner[i], blocks, 0, 0, 0
            blocks += 1
        block[i], inner_x[i], inner_y[i] = shelf_block, x, y
        x += width
        shelf_height = max(shelf_height, height)
    return block, inner_x, inner_y, blocks


@njit(cache=True)
def _occupy(taken: BoolArray, row: int, column: int, height: int, width: int) -> None:
    for y in range(row, row + height):
        for x in range(column, column + width):
            taken[y, x] = True


@njit(cache=True)
def _is_free(taken: BoolArray, row: int, column: int, height: int, width: int) -> bool:
    for y in range(row, row + height):
        for x in range(column, column + width):
            if taken[y, x]:
                return False
    return True


@njit(cache=True)
def _first_fit(place: Int64Array, size: Int64Array, side: int, open_pages: int) -> None:
    """Place blocks without a page, in place, on the last `open_pages` pages of side x side chunks."""
    pages = 0
    for i in range(len(place)):
        pages = max(pages, place[i, 0] + 1)
    taken = np.zeros((pages + max(1, len(place)), side, side), np.bool_)
    free = np.full(len(taken), side * side, np.int64)
    for i in range(len(place)):
        page, column, row = place[i]
        if page >= 0:
            _occupy(taken[page], row, column, size[i, 1], size[i, 0])
            free[page] -= size[i, 0] * size[i, 1]
    for i in range(len(place)):
        if place[i, 0] >= 0:
            continue
        width, height = size[i, 0], size[i, 1]
        for p in range(max(0, pages - open_pages), pages + 1):
            if free[p] < width * height:
                continue
            for row in range(side - height + 1):
                for column in range(side - width + 1):
                    if _is_free(taken[p], row, column, height, width):
                        _occupy(taken[p], row, column, height, width)
                        free[p] -= width * height
                        place[i, 0], place[i, 1], place[i, 2] = p, column, row
                        break
                if place[i, 0] >= 0:
                    break
            if place[i, 0] >= 0:
                pages = max(pages, p + 1)
                break
