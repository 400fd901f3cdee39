"""Check of full equirectangular panoramas: the sides meet, and the first row is one point of the sky."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import UInt8Array
from facade_core.core.errors import ImageError
from facade_core.imagery.rectify.fisheye import is_fisheye

# Width and height at which the picture is checked.
CHECK_SIZE = (1024, 512)
# Rows between which the sides are compared, as shares of the height: above is only sky,
TOP_SHARE = 0.25
# below is the camera's own vehicle.
BOTTOM_SHARE = 0.65
# Step from the last column to the first in usual steps (real panoramas: up to 3.3, photos from 6.8).
MAX_STEP_RATIO = 5.0
# Standard deviation of the first rows in grey levels (real panoramas: up to 2.9, photos from 9.2).
MAX_POLE_DEVIATION = 6.0
# Pixels over which a row is averaged first, against noise.
POLE_BLUR = 15


def check_full_panorama(image: UInt8Array) -> None:
    """Raise an error, with the remedy, unless a picture is a full panorama.

    Parameters
    ----------
    image : (H, W, 3) uint8, twice as wide as high.

    Raises
    ------
    ImageError
        If the picture is a fisheye picture, or cut off.
    """
    import cv2

    small = cv2.resize(image, CHECK_SIZE, interpolation=cv2.INTER_AREA).astype(np.float64)
    if is_fisheye(image):
        raise ImageError("is a fisheye picture, not an equirectangular panorama: stitch it, or remove it")
    rows = slice(round(TOP_SHARE * len(small)), round(BOTTOM_SHARE * len(small)))
    step = np.abs(np.diff(small[rows], axis=1)).mean()
    across = np.abs(small[rows, 0] - small[rows, -1]).mean()
    if across > MAX_STEP_RATIO * max(step, 1.0):
        raise ImageError(
            f"is cut off, or no panorama: its left and right sides do not meet ({across:.0f} grey levels apart, where columns "
            f"side by side differ by {step:.0f}); give the whole one or its GPano tags, or remove it"
        )
    if (varies := cv2.blur(small[:2].mean(axis=0)[None], (POLE_BLUR, 1)).std(axis=1).mean()) > MAX_POLE_DEVIATION:
        raise ImageError(
            f"is cut off, or no panorama: its first row, which is one point of the sky, varies by {varies:.0f} grey levels; "
            "give the whole one or its GPano tags, or remove it"
        )
