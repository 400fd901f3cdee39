"""Slope of the level lines of a rectified facade, which are level only where its own plane was rectified."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.imagery.rectify.line_segments import detect_segments_in_grey

# Level lines of a facade slope less than this once it is rectified; more are of another wall, a tree or a street.
MAX_LEVEL_SLOPE_DEG = 3.5
# Longest side in pixels of the picture in which lines are detected, and their least length as a share of it.
WORKING_SIDE_PX = 900
MIN_LENGTH_SHARE = 0.03
# Lines up to this angle from the level, in degrees, are counted: steeper ones are upright or of gables.
MAX_SLOPE_DEG = 35.0
# Fewer lines say nothing.
MIN_LINES = 20
# Margin around hidden pixels, in pixels of the working picture: their outline is not a line of the facade.
HIDDEN_RIM_PX = 7


def measure_level_slope(image: UInt8Array, hidden: BoolArray) -> float:
    """Return the median angle of a facade's level lines to the rows, weighted by length, in degrees.

    Parameters
    ----------
    image : (h, w, 3) uint8.
    hidden : (h, w) bool, pixels that do not show the facade.

    Returns
    -------
    Degrees; 0 for fewer than MIN_LINES lines.
    """
    import cv2

    shrink = min(1.0, WORKING_SIDE_PX / max(hidden.shape))
    size = (max(1, round(hidden.shape[1] * shrink)), max(1, round(hidden.shape[0] * shrink)))
    grey = cv2.resize(cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY), size, interpolation=cv2.INTER_AREA)
    ends = detect_segments_in_grey(grey)
    beside = cv2.resize(hidden.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)
    beside = cv2.dilate(beside, np.ones((HIDDEN_RIM_PX, HIDDEN_RIM_PX), np.uint8))
    x, y = np.clip(ends.mean(axis=1).astype(np.int64), 0, np.array(size) - 1).T
    across, down = (ends[:, 1] - ends[:, 0]).T
    length, slope = np.hypot(across, down), np.degrees(np.arctan2(np.abs(down), np.abs(across)))
    level = (length >= MIN_LENGTH_SHARE * max(size)) & (slope < MAX_SLOPE_DEG) & (beside[y, x] == 0)
    if level.sum() < MIN_LINES:
        return 0.0
    order = np.argsort(slope[level])
    total = np.cumsum(length[level][order])
    return float(slope[level][order][np.searchsorted(total, total[-1] / 2)])
