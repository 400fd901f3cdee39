"""Chart rasters between memory and the atlas pages: whole chunks, replicated gutters."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from facade_core.core.arrays import AnyArray, Int64Array, IntArray, UInt8Array, UInt64Array
from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.errors import StoreError
from facade_core.core.zarr_types import StoreArray, StoreGroup
from facade_core.geometry.chart_packing import THIN_DIVISOR, ChartPlacements


@dataclass(frozen=True)
class TexelLayout:
    """Layout of some charts' texels in one flat array, row-major within a chart.

    Texel (row, column) of chart c has the index offset[c] + row * width[c] + column.

    Attributes
    ----------
    charts : (k,) chart ids in memory order.
    offset : (n,) int64 over all n charts of the block, -1 for charts outside the layout.
    total : number of texels.
    """

    charts: Int64Array
    offset: Int64Array
    total: int

    @classmethod
    def of_charts(cls, placement: ChartPlacements, charts: Iterable[int]) -> TexelLayout:
        """Lay out charts in the given order."""
        chart_ids = np.array(list(charts), np.int64)
        size = placement.width[chart_ids].astype(np.int64) * placement.height[chart_ids]
        offset = np.full(len(placement.page), -1, np.int64)
        offset[chart_ids] = np.cumsum(size) - size
        return cls(chart_ids, offset, int(size.sum()))

    def texel_slice(self, placement: ChartPlacements, chart: int) -> slice:
        """Return the slice of a chart's texels in the flat array."""
        start = int(self.offset[chart])
        return slice(start, start + int(placement.width[chart]) * int(placement.height[chart]))


def read_rasters(array: StoreArray, placement: ChartPlacements, layout: TexelLayout) -> AnyArray:
    """Read the layout's texels from a page array; a chunk that small charts share is read once.

    Parameters
    ----------
    array : (page, y, x, ...) array of the store.
    placement : place of every chart on the pages.
    layout : charts to read.

    Returns
    -------
    (total, ...) texel values.
    """
    flat = np.empty((layout.total, *array.shape[3:]), array.dtype)
    chunk = array.chunks[1]
    shared: dict[tuple[int, int, int], AnyArray] = {}
    for c in layout.charts:
        page, y, x = int(placement.page[c]), int(placement.y[c]), int(placement.x[c])
        height, width = placement.shape(c)
        cell = (page, y // chunk, x // chunk)
        if cell[1:] == ((y + height - 1) // chunk, (x + width - 1) // chunk):
            if cell not in shared:
                shared[cell] = np.asarray(array[_chunk_region(cell, chunk)])
            block = shared[cell][y % chunk : y % chunk + height, x % chunk : x % chunk + width]
        else:
            block = np.asarray(array[page, y : y + height, x : x + width])
        flat[layout.texel_slice(placement, c)] = block.reshape(-1, *array.shape[3:])
    return flat


def read_chart_raster(group: StoreGroup, placement: ChartPlacements, chart: int, name: str) -> AnyArray:
    """Read the texels (h, w, ...) of a chart in an array of the store, such as facade_maps/labels."""
    return np.asarray(group[name][placement.region(chart)])


def write_rasters(
    array: StoreArray, spec: AtlasSpec, placement: ChartPlacements, layout: TexelLayout, flat: AnyArray
) -> None:
    """Write the layout's texels and their gutters to a page array.

    A chart larger than half a chunk owns its chunks and is written as whole chunks. Smaller and thin charts share
    chunks. Each shared chunk is read and rewritten once, which only the unit that owns the building may do.

    Parameters
    ----------
    array : (page, y, x, ...) array of the store.
    spec : chunk and gutter size.
    placement : place of every chart on the pages.
    layout : charts to write.
    flat : (total, ...) texel values.
    """
    shared: dict[tuple[int, int, int], list[tuple[int, int, AnyArray]]] = {}
    for c in layout.charts:
        height, width = placement.shape(c)
        raster = flat[layout.texel_slice(placement, c)].reshape(height, width, *array.shape[3:])
        page, y, x = int(placement.page[c]), int(placement.y[c]) - spec.gutter, int(placement.x[c]) - spec.gutter
        colour = [(0, 0)] * (raster.ndim - 2)
        block = np.pad(raster, [(spec.gutter,) * 2, (spec.gutter,) * 2, *colour], mode="edge")
        high, wide = block.shape[:2]
        if max(high, wide) > spec.chunk // 2 and high > spec.chunk // THIN_DIVISOR:
            rows, columns = (-size % spec.chunk for size in block.shape[:2])
            block = np.pad(block, [(0, rows), (0, columns), *colour])
            write_chunks(array, (page, slice(y, y + block.shape[0]), slice(x, x + block.shape[1])), block)
            continue
        row = y // spec.chunk
        for column in range(x // spec.chunk, (x + wide - 1) // spec.chunk + 1):
            left, right = max(x, column * spec.chunk), min(x + wide, (column + 1) * spec.chunk)
            part = (y % spec.chunk, left % spec.chunk, block[:, left - x : right - x])
            shared.setdefault((page, row, column), []).append(part)
    for cell, members in shared.items():
        region = _chunk_region(cell, spec.chunk)
        whole = np.array(array[region])
        for y, x, block in members:
            whole[y : y + block.shape[0], x : x + block.shape[1]] = block
        write_chunks(array, region, whole)


def write_chunks(array: StoreArray, region: tuple[int, slice, slice], values: AnyArray) -> None:
    """Write a region of a page as whole chunks: each chunk has one writer.

    Parameters
    ----------
    array : (page, y, x, ...) array of the store.
    region : page, rows and columns, aligned to chunks.
    values : values of the region.

    Raises
    ------
    StoreError
        The region is not aligned to chunks or exceeds the page.
    """
    for part, chunk, size in zip(region[1:], array.chunks[1:], array.shape[1:], strict=False):
        if part.start % chunk or part.stop % chunk or not 0 <= part.start < part.stop <= size:
            raise StoreError(
                f"{array.path}: rows {region[1].start}:{region[1].stop}, columns {region[2].start}:{region[2].stop} of page "
                f"{region[0]} do not begin and end on chunks of {chunk} within {size}; place charts by geometry.pack"
            )
    array[region] = values


def _chunk_region(cell: tuple[int, int, int], chunk: int) -> tuple[int, slice, slice]:
    page, row, column = cell
    return page, slice(row * chunk, (row + 1) * chunk), slice(column * chunk, (column + 1) * chunk)


def chart_digests(
    colour: UInt8Array, provenance: IntArray, placement: ChartPlacements, layout: TexelLayout, ids: UInt64Array
) -> dict[str, str]:
    """Compute the digest of colour and provenance of every chart of a layout.

    Independent of the chart's place on the pages.

    Parameters
    ----------
    colour : (total, 3) uint8 texels.
    provenance : (total,) uint8 texels.
    placement : place of every chart on the pages.
    layout : charts to digest.
    ids : (charts,) uint64 id of every chart of the block.

    Returns
    -------
    Hexadecimal digest by hexadecimal chart id.
    """
    digests: dict[str, str] = {}
    for c in layout.charts.tolist():
        texels = layout.texel_slice(placement, c)
        digest = hashlib.blake2b(np.ascontiguousarray(colour[texels]).tobytes(), digest_size=8)
        digest.update(np.ascontiguousarray(provenance[texels]).tobytes())
        digests[f"{int(ids[c]):016x}"] = digest.hexdigest()
    return digests


def describe_completeness(sources: Iterable[AnyArray]) -> dict[str, bool]:
    """Return the field `is_complete` of a record of charts with these sources of texels, 0 for none; {} without any texel.

    Chunks of texels without a source are never written: only what has some can be lost.
    """
    found = [source != 0 for source in sources]
    return {"is_complete": all(map(np.all, found))} if any(map(np.any, found)) else {}


def picture_digest(rgb: UInt8Array) -> str:
    """Compute the digest of a picture's pixels, hexadecimal."""
    return hashlib.blake2b(np.ascontiguousarray(rgb).tobytes(), digest_size=8).hexdigest()
