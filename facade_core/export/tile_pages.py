"""The charts of a tile on pages of powers of two, cut to what their triangles show."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facade_core.export.models import Drawn, Textured
from facade_core.export.packing import CELL, LARGEST_PAGE, mask_of, pack_pages, room
from facade_core.export.pages import scaled
from facade_core.grouping import grouped


@dataclass(frozen=True)
class TilePages:
    """Charts on pages; masks of cells with their borders; used, texels that triangles show."""

    drawn: Drawn
    masks: tuple[np.ndarray, ...]
    used: float

    @property
    def texels(self) -> int:
        """Of all pages."""
        return int(self.drawn.layout.pages.prod(axis=1).sum())

    def picture(self, page: int) -> np.ndarray:
        """A page (h, w, 3) uint8: what is shown with its border, and their mean between."""
        drawn, layout = self.drawn, self.drawn.layout
        width, height = layout.pages[page].tolist()
        image = np.zeros((height, width, 3), np.uint8)
        free = np.ones((height, width), bool)
        for i in np.flatnonzero(layout.page == page).tolist():
            w, h = layout.size[i].tolist()
            raster = scaled(drawn.source.raster(int(drawn.charts[i])), (w, h))
            taken = np.kron(self.masks[i], np.ones((CELL, CELL), bool))
            rows, columns = taken.shape
            padded = np.pad(raster, [(CELL, rows - h - CELL), (CELL, columns - w - CELL), (0, 0)], mode="edge")
            top, left = int(layout.y[i]) - CELL, int(layout.x[i]) - CELL
            place = (slice(top, top + rows), slice(left, left + columns))
            np.copyto(image[place], padded, where=taken[..., None])
            free[place] &= ~taken
        if free.any() and not free.all():
            mean = image.sum(axis=(0, 1)) / (free.size - np.count_nonzero(free))
            np.copyto(image, mean.round().astype(np.uint8), where=free[..., None])
        return image


def tile_pages(source: Textured, charts: np.ndarray, scale: float = 1.0) -> TilePages:
    """Pages of charts (k,), ascending, at `scale` of their texels."""
    wanted = np.maximum(1, np.ceil(source.texels[charts] * scale - 1e-6)).astype(np.int64)
    size = room(np.minimum(wanted, LARGEST_PAGE))
    of_chart = grouped(source.mesh.chart)
    masks, used = [], 0.0
    for chart, (width, height) in zip(charts.tolist(), size.tolist(), strict=True):
        corners = source.coordinates[source.mesh.triangles[of_chart[chart]]] / source.extent[chart] * [width, height]
        masks.append(mask_of(corners, (width, height)))
        (ax, ay), (bx, by) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
        used += float(np.abs(ax * by - ay * bx).sum() / 2)
    return TilePages(Drawn(source, charts, pack_pages(masks, size)), tuple(masks), used)
