"""Detail that two views of a surface share: proof that both show the surface, and nothing in front of it.

The occluder parser was trained on pictures of facades and takes much bare ground for an occluder. An object in front of a
surface appears at different places on it in two pictures, so that its detail does not correlate between them (Collins 1996).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array
from facade_core.core.types import Pose
from facade_core.imagery.cameras.agreement import MAX_LOG_DIFFERENCE, mean_log_colour, squares_to_texels
from facade_core.imagery.panorama_camera import camera_position
from facade_core.imagery.rectify.fusion import ChartView

# Side in metres of the cells whose colours are correlated,
DETAIL_CELL_M = 0.125
# and cells along a side of the windows of the correlation.
WINDOW_CELLS = 9
# Share of a window that both views must show.
MIN_SHARED_SHARE = 0.5
# Correlation from which views show the same detail,
MIN_CORRELATION = 0.6
# where both have detail: standard deviation of log brightness. Sensor noise and compression have less.
MIN_DETAIL = 0.03
# Cells along a side of the neighbourhood of a cell of which more than this share must be alike: single cells agree by chance,
# and windows reach over the outline of an object.
NEIGHBOUR_CELLS = 5
MIN_ALIKE_SHARE = 0.8
# Distance between two cameras over the larger height above the surface, from which an object 0.3 m high is shifted by 0.15 m.
MIN_PARALLAX = 0.5


def select_parallax_pairs(poses: Sequence[Pose], height: float) -> list[tuple[int, int]]:
    """Return the pairs of cameras between which objects on a level surface at a height in metres are shifted."""
    places = np.array([camera_position(pose) for pose in poses]).reshape(-1, 3)
    return [
        (i, j)
        for i in range(len(places))
        for j in range(i)
        if np.hypot(*(places[i] - places[j])[:2]) >= MIN_PARALLAX * (max(places[i][2], places[j][2]) - height)
    ]


def find_matching_detail(
    views: Sequence[ChartView], density: float, pairs: Iterable[tuple[int, int]]
) -> list[BoolArray]:
    """Find the seen texels of each view, occluded or not, whose detail another view shows at the same place.

    Parameters
    ----------
    views : views of one chart, of equal size and exposure.
    density : texels per metre.
    pairs : views that may be compared.

    Returns
    -------
    One mask (h, w) bool per view.

    References
    ----------
    Collins 1996, "A space-sweep approach to true multi-image matching".
    """
    import cv2

    side = max(1, round(DETAIL_CELL_M * density))
    cells = [mean_log_colour(view.rgb, view.seen, side) for view in views]
    matched = [np.zeros(share.shape, bool) for _, share in cells]
    for i, j in pairs:
        both = (cells[i][1] > MIN_SHARED_SHARE) & (cells[j][1] > MIN_SHARED_SHARE)
        if not both.any():
            continue
        alike = both & (np.abs(cells[i][0] - cells[j][0]).max(axis=2) <= MAX_LOG_DIFFERENCE)
        alike &= _correlation(cells[i][0].mean(axis=2), cells[j][0].mean(axis=2), both) >= MIN_CORRELATION
        most = (cv2.blur(alike.astype(np.float32), (NEIGHBOUR_CELLS,) * 2) > MIN_ALIKE_SHARE) & both
        matched[i] |= most
        matched[j] |= most
    return [
        squares_to_texels(cell, side, view.seen.shape) & view.seen for cell, view in zip(matched, views, strict=True)
    ]


def _correlation(first: Float32Array, second: Float32Array, both: BoolArray) -> Float32Array:
    """Correlate two rasters (r, c) over the window around each cell, -1 where they share too little or lack detail."""
    import cv2

    def mean(values: Float32Array) -> Float32Array:
        return np.asarray(cv2.blur(values * both, (WINDOW_CELLS, WINDOW_CELLS)) / share, np.float32)

    shared = np.asarray(cv2.blur(both.astype(np.float32), (WINDOW_CELLS, WINDOW_CELLS)), np.float32)
    share = np.maximum(shared, 1e-6)
    first, second = first - mean(first), second - mean(second)
    deviations = [np.sqrt(np.maximum(mean(one * one) - mean(one) ** 2, 0)) for one in (first, second)]
    covariance = mean(first * second) - mean(first) * mean(second)
    has_detail = (np.minimum(*deviations) > MIN_DETAIL) & (shared > MIN_SHARED_SHARE)
    return np.where(has_detail, covariance / np.maximum(deviations[0] * deviations[1], 1e-9), -1).astype(np.float32)
