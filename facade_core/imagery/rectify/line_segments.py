"""Straight line segments in pictures."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import AnyArray, BoolArray, Float64Array, UInt8Array

# Segments closer than this to pixels that do not count belong to their outline.
RIM_PIXELS = 4
# Places along a segment that must be off the outline, as shares of its length.
_CHECKED_SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)


def detect_segments_in_grey(grey: AnyArray) -> Float64Array:
    """Detect the line segments (k, 2, 2) of a grey picture (h, w): x, y of both ends, pixel centres at whole numbers."""
    import cv2

    found = cv2.createLineSegmentDetector().detect(grey)[0] if grey.min() < grey.max() else None
    return np.zeros((0, 2, 2)) if found is None else np.asarray(found, np.float64).reshape(-1, 2, 2)


def detect_line_segments(rgb: UInt8Array, usable: BoolArray, min_length: float) -> Float64Array:
    """Detect the line segments of a picture that keep off the outline of its usable pixels.

    Parameters
    ----------
    rgb : (h, w, 3) uint8.
    usable : (h, w) bool.
    min_length : shortest segment in pixels.

    Returns
    -------
    (k, 2, 2) x, y of both ends in pixels; the first pixel reaches from 0 to 1.
    """
    import cv2

    ends = detect_segments_in_grey(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY)) + 0.5
    side = 2 * RIM_PIXELS + 1
    inside = cv2.erode(usable.astype(np.uint8), np.ones((side, side), np.uint8), borderValue=0) > 0
    valid = np.hypot(*(ends[:, 1] - ends[:, 0]).T) >= min_length
    for share in _CHECKED_SHARES:
        pixel = np.floor(ends[:, 0] + share * (ends[:, 1] - ends[:, 0])).astype(int)
        valid &= inside[pixel[:, 1].clip(0, usable.shape[0] - 1), pixel[:, 0].clip(0, usable.shape[1] - 1)]
    return np.asarray(ends[valid], np.float64)
