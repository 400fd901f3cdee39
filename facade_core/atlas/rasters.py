"""Chart rasters between memory and the atlas pages: whole chunks, gutters replicated."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.errors import StoreError
from facade_core.core.zarr_types import StoreArray
from facade_core.geometry.chart_packing import THIN, Placement


@dataclass(frozen=True)
class TexelLayout:
    """The texels of some charts laid end to end, row-major within a chart.

    charts (k,) chart ids in their order in memory; offset (n,) int64 over ALL charts of the block: texel (row, column) of
    chart c is at offset[c] + row * width[c] + column, and -1 where the chart is not held; total texels in all.
    """

    charts: np.ndarray
    offset: np.ndarray
    total: int

    @classmethod
    def of(cls, placement: Placement, charts: Iterable[int]) -> TexelLayout:
        held = np.array(list(charts), np.int64)
        size = placement.width[held].astype(np.int64) * placement.height[held]
        offset = np.full(len(placement.page), -1, np.int64)
        offset[held] = np.cumsum(size) - size
        return cls(held, offset, int(size.sum()))

    def slice(self, placement: Placement, chart: int) -> slice:
        start = int(self.offset[chart])
        return slice(start, start + int(placement.width[chart]) * int(placement.height[chart]))


def read_rasters(array: StoreArray, placement: Placement, layout: TexelLayout) -> np.ndarray:
    """The held charts' texels of a (page, y, x, ...) array: (total, ...). A chunk that small charts share is read once."""
    flat = np.empty((layout.total, *array.shape[3:]), array.dtype)
    chunk = array.chunks[1]
    shared: dict[tuple[int, int, int], np.ndarray] = {}
    for c in layout.charts:
        page, y, x = int(placement.page[c]), int(placement.y[c]), int(placement.x[c])
        height, width = int(placement.height[c]), int(placement.width[c])
        cell = (page, y // chunk, x // chunk)
        if cell[1:] == ((y + height - 1) // chunk, (x + width - 1) // chunk):
            if cell not in shared:
                shared[cell] = np.asarray(array[_chunk_region(cell, chunk)])
            block = shared[cell][y % chunk : y % chunk + height, x % chunk : x % chunk + width]
        else:
            block = np.asarray(array[page, y : y + height, x : x + width])
        flat[layout.slice(placement, c)] = block.reshape(-1, *array.shape[3:])
    return flat


def write_rasters(array: StoreArray, spec: AtlasSpec, placement: Placement, layout: TexelLayout, flat: np.ndarray) -> None:
    """Write the held charts' texels (total, ...) and their gutters into a (page, y, x, ...) array.

    A chart larger than half a chunk owns its chunks and is written as whole chunks; smaller ones, and thin ones, share theirs,
    each of which is read and rewritten once: only the unit that owns the building may do that.
    """
    shared: dict[tuple[int, int, int], list[tuple[int, int, np.ndarray]]] = {}
    for c in layout.charts:
        height, width = int(placement.height[c]), int(placement.width[c])
        raster = flat[layout.slice(placement, c)].reshape(height, width, *array.shape[3:])
        page, y, x = int(placement.page[c]), int(placement.y[c]) - spec.gutter, int(placement.x[c]) - spec.gutter
        colour = [(0, 0)] * (raster.ndim - 2)
        block = np.pad(raster, [(spec.gutter,) * 2, (spec.gutter,) * 2, *colour], mode="edge")
        high, wide = block.shape[:2]
        if max(high, wide) > spec.chunk // 2 and high > spec.chunk // THIN:
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


def write_chunks(array: StoreArray, region: tuple[int, slice, slice], values: np.ndarray) -> None:
    """Write a region of a page (page, rows, columns) that begins and ends on chunks: a chunk has one writer, and is written
    whole. Raises StoreError for any other."""
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
    colour: np.ndarray, provenance: np.ndarray, placement: Placement, layout: TexelLayout, ids: np.ndarray
) -> dict[str, str]:
    """Digest of colour (total, 3) and provenance (total,) of every held chart: its id of `ids` (charts,) uint64, in hexadecimal
    -> hex. The same wherever the chart lies on the pages."""
    digests: dict[str, str] = {}
    for c in layout.charts.tolist():
        texels = layout.slice(placement, c)
        digest = hashlib.blake2b(np.ascontiguousarray(colour[texels]).tobytes(), digest_size=8)
        digest.update(np.ascontiguousarray(provenance[texels]).tobytes())
        digests[f"{int(ids[c]):016x}"] = digest.hexdigest()
    return digests


def picture_digest(rgb: np.ndarray) -> str:
    """Digest of a picture's pixels, hexadecimal."""
    return hashlib.blake2b(np.ascontiguousarray(rgb).tobytes(), digest_size=8).hexdigest()


def chunk_digests(
    colour: StoreArray, provenance: StoreArray, spec: AtlasSpec, placement: Placement, charts: Iterable[int]
) -> dict[str, str]:
    """Digest of colour and provenance of every chunk that holds one of `charts`: "page/row/column" -> hex."""
    digests: dict[str, str] = {}
    for c in charts:
        chunks = placement.chunks(int(c), spec.chunk, spec.gutter)
        page, row, column = (int(v) for v in chunks[0])
        if f"{page}/{row}/{column}" in digests:
            continue
        rows, columns = (int(v) for v in chunks[-1, 1:] - chunks[0, 1:] + 1)
        region = (
            page,
            slice(row * spec.chunk, (row + rows) * spec.chunk),
            slice(column * spec.chunk, (column + columns) * spec.chunk),
        )
        blocks = [np.asarray(a[region]) for a in (colour, provenance)]
        for r in range(rows):
            for k in range(columns):
                digest = hashlib.blake2b(digest_size=8)
                for block in blocks:
                    part = block[r * spec.chunk : (r + 1) * spec.chunk, k * spec.chunk : (k + 1) * spec.chunk]
                    digest.update(np.ascontiguousarray(part).tobytes())
                digests[f"{page}/{row + r}/{column + k}"] = digest.hexdigest()
    return digests
