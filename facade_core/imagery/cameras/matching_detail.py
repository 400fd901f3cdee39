"""Detail that two views of a surface share: proof that both show the surface, and nothing in front of it.

The occluder parser was trained on pictures of facades and takes much bare ground for an occluder. An object in front of a
surface appears at different places on it in two pictures, so that its detail does not correlate between them (Collins 1996).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array
from facade_core.core.types import Pose
from facade_core.imagery.cameras.agreement import mean_log_colour, squares_to_texels
from facade_core.imagery.cameras.settings import AGREEMENT, DETAIL
from facade_core.imagery.panorama_camera import camera_position
from facade_core.imagery.rectify.fusion import ChartView


def select_parallax_pairs(poses: Sequence[Pose], height: float) -> list[tuple[int, int]]:
    """Return the pairs of cameras between which objects on a level surface at a height in metres are shifted."""
    places = np.array([camera_position(pose) for pose in poses]).reshape(-1, 3)
    return [
        (i, j)
        for i in range(len(places))
        for j in range(i)
        if np.hypot(*(places[i] - places[j])[:2]) >= DETAIL.min_parallax * (max(places[i][2], places[j][2]) - height)
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

    side = max(1, round(DETAIL.detail_cell_m * density))
    cells = [mean_log_colour(view.rgb, view.seen, side) for view in views]
    matched = [np.zeros(share.shape, bool) for _, share in cells]
    for i, j in pairs:
        both = (cells[i][1] > DETAIL.min_shared_share) & (cells[j][1] > DETAIL.min_shared_share)
        if not both.any():
            continue
        alike = both & (np.abs(cells[i][0] - cells[j][0]).max(axis=2) <= AGREEMENT.max_log_difference)
        alike &= _correlation(cells[i][0].mean(axis=2), cells[j][0].mean(axis=2), both) >= DETAIL.min_correlation
        most = (cv2.blur(alike.astype(np.float32), (DETAIL.neighbour_cells,) * 2) > DETAIL.min_alike_share) & both
        matched[i] |= most
        matched[j] |= most
    return [
        squares_to_texels(cell, side, view.seen.shape) & view.seen for cell, view in zip(matched, views, strict=True)
    ]


def _correlation(first: Float32Array, second: Float32Array, both: BoolArray) -> Float32Array:
    """Correlate two rasters (r, c) over the window around each cell, -1 where they share too little or lack detail."""
    import cv2

    def mean(values: Float32Array) -> Float32Array:
        return np.asarray(cv2.blur(values * both, (DETAIL.window_cells, DETAIL.window_cells)) / share, np.float32)

    shared = np.asarray(cv2.blur(both.astype(np.float32), (DETAIL.window_cells, DETAIL.window_cells)), np.float32)
    share = np.maximum(shared, 1e-6)
    first, second = first - mean(first), second - mean(second)
    deviations = [np.sqrt(np.maximum(mean(one * one) - mean(one) ** 2, 0)) for one in (first, second)]
    covariance = mean(first * second) - mean(first) * mean(second)
    has_detail = (np.minimum(*deviations) > DETAIL.min_detail) & (shared > DETAIL.min_shared_share)
    return np.where(has_detail, covariance / np.maximum(deviations[0] * deviations[1], 1e-9), -1).astype(np.float32)
