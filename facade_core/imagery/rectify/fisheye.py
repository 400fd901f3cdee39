"""Fisheye pictures declared as equirectangular panoramas, recognised by the black around their circles."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import UInt8Array

# Grey level below which the surroundings of a lens's circle are black
BLACK_LEVEL = 24.0
# and their largest deviation from the median; lenses cast some light on them.
BLACK_SPREAD = 8.0
# Share of the pixels outside the circles that are black; the circle's rim and a maker's mark are not.
MIN_BLACK_SHARE = 0.97
# Circles are enlarged by this: lens circles are not centred to the pixel.
CIRCLE_SCALE = 1.06
# Mean grey level inside the circles; night pictures are dark everywhere.
MIN_BRIGHTNESS = 40.0


def is_fisheye(image: UInt8Array) -> bool:
    """Return True if a picture (h, w, 3) uint8 shows one fisheye circle, or two next to each other.

    The corners outside a circle in each square are black, and the inside is not. A panorama's corners are sky and
    street.
    """
    grey = image.mean(axis=2)
    height, width = grey.shape
    circles = max(1, round(width / height))
    x = ((np.arange(width) + 0.5) * circles / width) % 1.0 - 0.5
    y = (np.arange(height) + 0.5) / height - 0.5
    outside = np.hypot(x, y[:, None]) > 0.5 * CIRCLE_SCALE
    corners, shown = grey[outside], grey[~outside]
    if len(corners) == 0 or shown.mean() < MIN_BRIGHTNESS:
        return False
    black = (corners < BLACK_LEVEL) & (np.abs(corners - np.median(corners)) <= BLACK_SPREAD)
    return bool(black.mean() >= MIN_BLACK_SHARE)
