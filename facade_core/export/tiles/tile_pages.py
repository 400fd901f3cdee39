"""Texture pages of a tile with powers of two as sides, cut to the texels that triangles show."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from facade_core.core.arrays import BoolArray, Int64Array, UInt8Array
from facade_core.core.grouping import group_rows
from facade_core.export.models.page_packing import (
    CELL_TEXELS,
    MAX_PAGE_TEXELS,
    pack_pages,
    rasterise_cells,
    shrink_for_border,
)
from facade_core.export.models.pages import PageImages, PageLayout, downscale, halve_layout
from facade_core.export.models.textured_mesh import PackedCharts, TexturedMesh, draw_page_maps


@dataclass(frozen=True)
class TilePages:
    """Charts packed on the pages of a tile.

    Attributes
    ----------
    packed : the charts with their layout.
    masks : cells of each chart with its border.
    used_texels : texels that triangles show.
    """

    packed: PackedCharts
    masks: tuple[BoolArray, ...]
    used_texels: float

    @property
    def page_texels(self) -> int:
        """Return the texels of all pages."""
        return int(self.packed.layout.pages.prod(axis=1).sum())

    def draw_images(self, page: int) -> PageImages:
        """Draw a page, with its maps if the source has them."""
        packed = self.packed

        def raster(i: int) -> UInt8Array:
            width, height = packed.layout.size[i].tolist()
            return downscale(packed.source.raster(int(packed.charts[i])), (width, height))

        half = halve_layout(packed.layout)
        return PageImages(
            self._draw_layer(packed.layout, page, raster, CELL_TEXELS),
            None
            if packed.source.maps is None
            else draw_page_maps(packed, page, lambda raster: self._draw_layer(half, page, raster, CELL_TEXELS // 2)),
        )

    def _draw_layer(self, layout: PageLayout, page: int, raster: Callable[[int], UInt8Array], cell: int) -> UInt8Array:
        """Draw a page (h, w, 3) uint8: masked rasters with their borders, and the mean colour between."""
        width, height = layout.pages[page].tolist()
        image = np.zeros((height, width, 3), np.uint8)
        free = np.ones((height, width), bool)
        for i in np.flatnonzero(layout.page == page).tolist():
            own = raster(i)
            h, w = own.shape[:2]
            taken = np.kron(self.masks[i], np.ones((cell, cell), bool))
            rows, columns = taken.shape
            padded = np.pad(own, [(cell, rows - h - cell), (cell, columns - w - cell), (0, 0)], mode="edge")
            top, left = int(layout.y[i]) - cell, int(layout.x[i]) - cell
            place = (slice(top, top + rows), slice(left, left + columns))
            np.copyto(image[place], padded, where=taken[..., None])
            free[place] &= ~taken
        if free.any() and not free.all():
            mean = image.sum(axis=(0, 1)) / (free.size - np.count_nonzero(free))
            np.copyto(image, mean.round().astype(np.uint8), where=free[..., None])
        return image


def pack_tile_pages(source: TexturedMesh, charts: Int64Array, scale: float = 1.0) -> TilePages:
    """Pack charts (k,), ascending, on pages at `scale` of their texels."""
    wanted = np.maximum(1, np.ceil(source.texels[charts] * scale - 1e-6)).astype(np.int64)
    size = shrink_for_border(np.minimum(wanted, MAX_PAGE_TEXELS))
    of_chart = group_rows(source.mesh.chart)
    masks, used = [], 0.0
    for chart, (width, height) in zip(charts.tolist(), size.tolist(), strict=True):
        corners = source.coordinates[source.mesh.triangles[of_chart[chart]]] / source.extent[chart] * [width, height]
        masks.append(rasterise_cells(corners, (width, height)))
        (ax, ay), (bx, by) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
        used += float(np.abs(ax * by - ay * bx).sum() / 2)
    return TilePages(PackedCharts(source, charts, pack_pages(masks, size)), tuple(masks), used)
