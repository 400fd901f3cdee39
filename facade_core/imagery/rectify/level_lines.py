"""Slope of the level lines of a rectified facade, which are level only where its own plane was rectified."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, UInt8Array
from facade_core.imagery.rectify.line_segments import detect_segments_in_grey
from facade_core.imagery.rectify.settings import LEVEL_LINES


def find_slope(image: UInt8Array, hidden: BoolArray) -> float | None:
    """Return the median angle to the rows of a facade's level lines, weighted by length, if its plane is not rectified.

    Parameters
    ----------
    image : (h, w, 3) uint8.
    hidden : (h, w) bool, pixels that do not show the facade.

    Returns
    -------
    Degrees; None of a rectified facade, and of fewer than LEVEL_LINES.min_lines lines.
    """
    slope, length = _level_lines(image, hidden)
    if len(slope) < LEVEL_LINES.min_lines:
        return None
    order = np.argsort(slope)
    total = np.cumsum(length[order])
    median = float(slope[order][np.searchsorted(total, total[-1] / 2)])
    is_level = length[slope < LEVEL_LINES.max_level_deg].sum() >= LEVEL_LINES.min_level_share * length.sum()
    return None if is_level or median <= LEVEL_LINES.max_level_slope_deg else median


def _level_lines(image: UInt8Array, hidden: BoolArray) -> tuple[Float64Array, Float64Array]:
    """Return the angles to the rows in degrees, and the lengths, of lines of up to LEVEL_LINES.max_slope_deg."""
    import cv2

    shrink = min(1.0, LEVEL_LINES.working_side_px / max(hidden.shape))
    size = (max(1, round(hidden.shape[1] * shrink)), max(1, round(hidden.shape[0] * shrink)))
    grey = cv2.resize(cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY), size, interpolation=cv2.INTER_AREA)
    ends = detect_segments_in_grey(grey)
    beside = cv2.resize(hidden.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)
    beside = cv2.dilate(beside, np.ones((LEVEL_LINES.hidden_rim_px, LEVEL_LINES.hidden_rim_px), np.uint8))
    x, y = np.clip(ends.mean(axis=1).astype(np.int64), 0, np.array(size) - 1).T
    across, down = (ends[:, 1] - ends[:, 0]).T
    length, slope = np.hypot(across, down), np.degrees(np.arctan2(np.abs(down), np.abs(across)))
    level = (
        (length >= LEVEL_LINES.min_length_share * max(size)) & (slope < LEVEL_LINES.max_slope_deg) & (beside[y, x] == 0)
    )
    return slope[level], length[level]
