"""A street's texels levelled to those of better rank beside them."""

from __future__ import annotations

import numpy as np

from facade_core.atlas.levelling import LEVELLED_M, LEVELLED_REACHES, level
from facade_core.atlas.provenance import TRANSLATED
from facade_core.atlas.rasters import Rasters
from facade_core.atlas.surroundings import pieces_around, surrounded
from facade_core.street.scene import Scene
from facade_core.street.window import Window


def levelled(scene: Scene, written: Rasters, window: Window) -> np.ndarray:
    """The colour (total, 3) of the charts `written` that a street writes, which come first in its window: what it translated is
    levelled to what the facade stages know of the same surface, on its own chart or beside it."""
    charts, placement, reach = scene.charts, scene.placement, LEVELLED_M * scene.spec.texels_per_metre
    margin = round(LEVELLED_REACHES * reach)
    colour = window.colour[: written.total].copy()
    known = np.zeros(len(charts), bool)
    for chart in window.rasters.charts.tolist():
        known[chart] = window.provenance[window.rasters.slice(placement, chart)].max(initial=0) > TRANSLATED

    def read(chart: int, rows: slice, columns: slice) -> tuple[np.ndarray, np.ndarray]:
        shape = (int(placement.height[chart]), int(placement.width[chart]))
        if window.rasters.offset[chart] < 0:
            empty = np.zeros(shape, np.uint8)[rows, columns]
            return np.repeat(empty[..., None], 3, axis=2), empty
        texels = window.rasters.slice(placement, chart)
        whole = window.colour[texels].reshape(*shape, 3), window.provenance[texels].reshape(shape)
        return whole[0][rows, columns], whole[1][rows, columns]

    for chart in written.charts.tolist():
        around = pieces_around(charts, chart, margin / scene.spec.texels_per_metre)
        texels = written.slice(placement, chart)
        if not (known[chart] or known[around].any()) or not (window.provenance[texels] == TRANSLATED).any():
            continue
        size = (int(placement.height[chart]), int(placement.width[chart]))
        wider = margin if len(around) else 0
        raster, provenance = surrounded(charts, scene.spec.texels_per_metre, chart, size, wider, read)
        raster = level(raster, provenance > TRANSLATED, provenance == TRANSLATED, reach=reach)
        colour[texels] = raster[wider : wider + size[0], wider : wider + size[1]].reshape(-1, 3)
    return colour
