"""Slope of the level lines of a rectified facade, which are level only where its own plane was rectified."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, UInt8Array
from facade_core.imagery.rectify.line_segments import detect_segments_in_grey

# Level lines of a facade slope less than this once it is rectified; more are of another wall, a tree or a street.
MAX_LEVEL_SLOPE_DEG = 3.5
# Share of the length of these lines within MAX_LEVEL_DEG of the rows, below which a steep median is of another plane: above it,
# lines that slope are braces, gables or fire escapes of a rectified facade.
MIN_LEVEL_SHARE = 0.3
MAX_LEVEL_DEG = 1.5
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
    slope, length = _level_lines(image, hidden)
    return _median_slope(slope, length)


def find_unrectified_slope(image: UInt8Array, hidden: BoolArray) -> float | None:
    """Return the slope in degrees of the level lines of a picture that is stated as rectified and is not, else None.

    Parameters as of `measure_level_slope`.
    """
    slope, length = _level_lines(image, hidden)
    median = _median_slope(slope, length)
    if median <= MAX_LEVEL_SLOPE_DEG or length[slope < MAX_LEVEL_DEG].sum() >= MIN_LEVEL_SHARE * length.sum():
        return None
    return median


def _median_slope(slope: Float64Array, length: Float64Array) -> float:
    """Return the median of slopes by length; 0 for fewer than MIN_LINES lines."""
    if len(slope) < MIN_LINES:
        return 0.0
    order = np.argsort(slope)
    total = np.cumsum(length[order])
    return float(slope[order][np.searchsorted(total, total[-1] / 2)])


def _level_lines(image: UInt8Array, hidden: BoolArray) -> tuple[Float64Array, Float64Array]:
    """Return the angles to the rows in degrees, and the lengths, of lines of up to MAX_SLOPE_DEG."""
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
    return slope[level], length[level]
