"""Charts into atlas pages: every chart starts on a chunk boundary, so that a chunk has one owner."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from facade_core.errors import GeometryError

# Pages still open for first fit: more would fill pages better, but scatter a building over the atlas.
OPEN_PAGES = 4


@dataclass(frozen=True)
class Placement:
    """Where each chart's texels lie: page, x, y (n,) int32 of the first texel inside the gutter; width, height (n,) int32.

    pages is how many pages there are. Rows (y, y + height) and columns (x, x + width) are half-open.
    """

    page: np.ndarray
    x: np.ndarray
    y: np.ndarray
    width: np.ndarray
    height: np.ndarray
    pages: int

    def chunks(self, chart: int, chunk: int, gutter: int) -> np.ndarray:
        """The chunks that hold chart's texels and gutters: (k, 3) int32 of page, chunk row, chunk column."""
        rows = np.arange(
            (self.y[chart] - gutter) // chunk, (self.y[chart] + self.height[chart] + gutter - 1) // chunk + 1
        )
        columns = np.arange(
            (self.x[chart] - gutter) // chunk, (self.x[chart] + self.width[chart] + gutter - 1) // chunk + 1
        )
        grid = np.stack(np.meshgrid(rows, columns, indexing="ij"), axis=-1).reshape(-1, 2)
        return np.column_stack([np.full(len(grid), self.page[chart]), grid]).astype(np.int32)


def pack(texels: np.ndarray, owner: np.ndarray, *, page: int, chunk: int, gutter: int) -> Placement:
    """Pack rasters of `texels` (n, 2) width and height into square pages of `page` texels.

    Charts up to half a chunk share chunks, but only with charts of the same `owner` (n,), the building; charts without one
    (-1) never share. Charts keep their order, first fit over the last few pages, so that neighbours stay together.
    Raises GeometryError for a chart larger than a page less its gutters.
    """
    outer = texels.astype(np.int64) + 2 * gutter
    if len(outer) and outer.max() > page:
        largest = int(np.argmax(outer.max(axis=1)))
        raise GeometryError(
            f"chart {largest} needs {outer[largest].max()} texels and a page has {page}; cut it or lower texels_per_metre"
        )
    block, inner_x, inner_y, blocks = _share_chunks(outer, np.asarray(owner, np.int64), chunk)
    size = np.ones((blocks, 2), np.int64)
    large = (outer > chunk // 2).any(axis=1)
    size[block[large]] = -(-outer[large] // chunk)
    block_page, block_x, block_y, pages = _first_fit(size, page // chunk)
    return Placement(
        page=block_page[block].astype(np.int32),
        x=(block_x[block] * chunk + inner_x + gutter).astype(np.int32),
        y=(block_y[block] * chunk + inner_y + gutter).astype(np.int32),
        width=texels[:, 0].astype(np.int32),
        height=texels[:, 1].astype(np.int32),
        pages=int(pages),
    )


@njit(cache=True)
def _share_chunks(outer, owner, chunk):
    """Each chart's block of whole chunks and its place in it; small charts of one owner go on shelves of one chunk."""
    n = len(outer)
    block = np.empty(n, np.int64)
    inner_x = np.zeros(n, np.int64)
    inner_y = np.zeros(n, np.int64)
    blocks = 0
    shelf_owner, shelf_block, x, y, shelf_height = -1, -1, 0, 0, 0
    for i in range(n):
        width, height = outer[i, 0], outer[i, 1]
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
def _first_fit(size, side):
    """Blocks of chunks on pages of side x side chunks: the first free place on the last OPEN_PAGES pages."""
    n = len(size)
    page = np.empty(n, np.int64)
    x = np.empty(n, np.int64)
    y = np.empty(n, np.int64)
    taken = np.zeros((max(1, n), side, side), np.bool_)
    pages = 0
    for i in range(n):
        width, height = size[i, 0], size[i, 1]
        placed = False
        for p in range(max(0, pages - OPEN_PAGES), pages + 1):
            for row in range(side - height + 1):
                for column in range(side - width + 1):
                    if not taken[p, row : row + height, column : column + width].any():
                        taken[p, row : row + height, column : column + width] = True
                        page[i], x[i], y[i] = p, column, row
                        placed = True
                        break
                if placed:
                    break
            if placed:
                pages = max(pages, p + 1)
                break
    return page, x, y, pages
