"""Whether a picture that says so is a full equirectangular panorama: its sides meet, its first row is one point of the sky."""

from __future__ import annotations

import numpy as np

from facade_core.core.errors import ImageError
from facade_core.imagery.rectify.fisheye import is_fisheye

# Looked at so small: width and height.
SMALL = (1024, 512)
# Rows of the height between which sides are compared: below is the camera's own vehicle, above only sky.
FIRST, LAST = 0.25, 0.65
# The step from the last column to the first, in usual steps, at most (real panoramas: up to 3.3, photos from 6.8).
STEP = 5.0
# Grey levels that the first rows vary by at most (real panoramas: up to 2.9, photos from 9.2).
POLE = 6.0
# Pixels over which a row is smoothed first: noise is no view.
SMOOTH = 15


def check_full_panorama(image: np.ndarray) -> None:
    """ImageError, with the remedy, where a picture (H, W, 3) uint8, twice as wide as high, is no full panorama."""
    import cv2

    small = cv2.resize(image, SMALL, interpolation=cv2.INTER_AREA).astype(np.float64)
    if is_fisheye(image):
        raise ImageError("is a fisheye picture, not an equirectangular panorama: stitch it, or remove it")
    rows = slice(round(FIRST * len(small)), round(LAST * len(small)))
    step = np.abs(np.diff(small[rows], axis=1)).mean()
    across = np.abs(small[rows, 0] - small[rows, -1]).mean()
    if across > STEP * max(step, 1.0):
        raise ImageError(
            f"is cut off, or no panorama: its left and right sides do not meet ({across:.0f} grey levels apart, where columns "
            f"side by side differ by {step:.0f}); give the whole one or its GPano tags, or remove it"
        )
    if (varies := cv2.blur(small[:2].mean(axis=0)[None], (SMOOTH, 1)).std(axis=1).mean()) > POLE:
        raise ImageError(
            f"is cut off, or no panorama: its first row, which is one point of the sky, varies by {varies:.0f} grey levels; "
            "give the whole one or its GPano tags, or remove it"
        )
