"""Colour for texels that nothing has textured: courtyards, roofs, ground out of range. Never stored, made when published."""

from __future__ import annotations

import numpy as np

from facade_core.atlas.levelling import LEVELLED_M, LEVELLED_REACHES, level, spread
from facade_core.atlas.provenance import UNSEEN
from facade_core.atlas.surroundings import Reader, pieces_around, surrounded
from facade_core.geometry.charts import GROUND
from facade_core.street.overhead import Aerial, from_above, raster_points
from facade_core.street.scene import Scene
from facade_core.street.translate import Swatches

# Swatches are evaluated for every second texel and interpolated: these surfaces are seen from afar.
STRIDE = 2


def fill_unseen(
    scene: Scene,
    swatches: Swatches,
    page: int,
    colour: np.ndarray,
    provenance: np.ndarray,
    *,
    levelling: bool = True,
    read: Reader | None = None,
    aerial: Aerial | None = None,
) -> np.ndarray:
    """A page's colour (h, w, 3) with the unseen texels of its charts and gutters painted, and with what lies between charts
    coloured like them, so that mipmaps do not bleed.

    Ground under the free sky takes the `aerial` picture where there is one, all else its material. With `levelling` what is
    painted is levelled to the seen texels of the same surface: of its own chart, and of the charts beside it where `read`
    gives the texels of any chart. provenance (h, w) stays as it is: UNSEEN says which texels were filled.
    """
    filled = colour.copy()
    owned = np.zeros(colour.shape[:2], bool)
    placement, gutter = scene.placement, scene.spec.gutter
    reach = LEVELLED_M * scene.spec.texels_per_metre
    for chart in np.flatnonzero(placement.page == page).tolist():
        size = (int(placement.height[chart]), int(placement.width[chart]))
        y, x = int(placement.y[chart]), int(placement.x[chart])
        own = (slice(y, y + size[0]), slice(x, x + size[1]))
        wide = (slice(y - gutter, y + size[0] + gutter), slice(x - gutter, x + size[1] + gutter))
        owned[wide] = True
        unseen = provenance[own] == UNSEEN
        if not unseen.any():
            continue
        raster = colour[own].copy()
        raster[unseen] = _painted(scene, swatches, chart, size, aerial)[unseen]
        if levelling:
            raster = _levelled(scene, chart, raster, provenance[own], read, reach)
        grown = np.pad(raster, [(gutter, gutter), (gutter, gutter), (0, 0)], mode="edge")
        empty = provenance[wide] == UNSEEN
        filled[wide][empty] = grown[empty]
    if owned.any() and not owned.all():
        between = np.round(spread(filled, owned)).astype(np.uint8)
        filled[~owned] = between[~owned]
    return filled


def _painted(scene: Scene, swatches: Swatches, chart: int, size: tuple[int, int], aerial: Aerial | None) -> np.ndarray:
    """A whole chart (h, w, 3) in its material, or as seen from above."""
    import cv2

    height, width = size
    rows = np.arange(-(-height // STRIDE)) * STRIDE + STRIDE / 2
    columns = np.arange(-(-width // STRIDE)) * STRIDE + STRIDE / 2
    points = raster_points(scene, chart, rows, columns)
    owner = np.full(points.shape[0] * points.shape[1], chart)
    footprint = np.full(len(owner), STRIDE / scene.spec.texels_per_metre)
    swatch = swatches.materials.colour(owner, points.reshape(-1, 3), footprint).reshape(*points.shape[:2], 3)
    painted = cv2.resize(swatch, (width, height), interpolation=cv2.INTER_LINEAR)
    if aerial is not None and scene.charts.kind[chart] == GROUND:
        rgb, known = from_above(scene, chart, aerial)
        painted[known] = rgb[known]
    return painted


def _levelled(
    scene: Scene, chart: int, raster: np.ndarray, provenance: np.ndarray, read: Reader | None, reach: float
) -> np.ndarray:
    """A chart's raster (h, w, 3), its unseen texels levelled to the seen ones of it and of the charts around."""
    margin, density, size = round(LEVELLED_REACHES * reach), scene.spec.texels_per_metre, provenance.shape
    if read is None or len(pieces_around(scene.charts, chart, margin / density)) == 0:
        return level(raster, provenance > UNSEEN, provenance == UNSEEN, reach=reach)
    around = read

    def with_own(one: int, rows: slice, columns: slice) -> tuple[np.ndarray, np.ndarray]:
        return (raster[rows, columns], provenance[rows, columns]) if one == chart else around(one, rows, columns)

    colour, known = surrounded(scene.charts, density, chart, (size[0], size[1]), margin, with_own)
    own = (slice(margin, margin + size[0]), slice(margin, margin + size[1]))
    free = np.zeros(known.shape, bool)
    free[own] = provenance == UNSEEN
    return level(colour, known > UNSEEN, free, reach=reach)[own]
