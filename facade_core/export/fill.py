"""Colour for texels that nothing has textured: courtyards, roofs, ground out of range. Never stored, made when published."""

from __future__ import annotations

import numpy as np

from facade_core.atlas.levelling import LEVELLED_M, level, spread
from facade_core.atlas.provenance import UNSEEN
from facade_core.street.scene import Scene
from facade_core.street.translate import Swatches

# Swatches are evaluated for every second texel and interpolated: these surfaces are seen from afar.
STRIDE = 2


def fill_unseen(scene: Scene, swatches: Swatches, page: int, colour: np.ndarray, provenance: np.ndarray) -> np.ndarray:
    """A page's colour (h, w, 3) with the unseen texels of its charts and gutters painted with their material, levelled to the
    seen texels of the same chart, and with what lies between charts coloured like them, so that mipmaps do not bleed.

    provenance (h, w) stays as it is: UNSEEN says which texels were filled.
    """
    import cv2

    filled = colour.copy()
    owned = np.zeros(colour.shape[:2], bool)
    placement, charts, gutter = scene.placement, scene.charts, scene.spec.gutter
    for chart in np.flatnonzero(placement.page == page):
        width, height = int(placement.width[chart]), int(placement.height[chart])
        x, y = int(placement.x[chart]) - gutter, int(placement.y[chart]) - gutter
        box = (slice(y, y + height + 2 * gutter), slice(x, x + width + 2 * gutter))
        owned[box] = True
        unseen = provenance[box] == UNSEEN
        if not unseen.any():
            continue
        rows = (np.arange(-(-height // STRIDE)) * STRIDE + STRIDE / 2) / scene.spec.texels_per_metre
        columns = (np.arange(-(-width // STRIDE)) * STRIDE + STRIDE / 2) / scene.spec.texels_per_metre
        points = (
            charts.origin[chart]
            + columns[None, :, None] * charts.axis_u[chart]
            + rows[:, None, None] * charts.axis_v[chart]
        )
        owner = np.full(points.shape[0] * points.shape[1], chart)
        swatch = swatches.colour(owner, points.reshape(-1, 3)).reshape(*points.shape[:2], 3)
        swatch = cv2.resize(swatch, (width, height), interpolation=cv2.INTER_LINEAR)
        swatch = np.pad(swatch, [(gutter, gutter), (gutter, gutter), (0, 0)], mode="edge")
        filled[box][unseen] = swatch[unseen]
        filled[box] = level(filled[box], ~unseen, unseen, reach=LEVELLED_M * scene.spec.texels_per_metre)
    if owned.any() and not owned.all():
        between = np.round(spread(filled, owned)).astype(np.uint8)
        filled[~owned] = between[~owned]
    return filled
