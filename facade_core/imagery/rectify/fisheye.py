"""Fisheye pictures that are said to be equirectangular panoramas, told by the black around their circles."""

from __future__ import annotations

import numpy as np

# Levels of a grey value that the black around a lens's circle is below, and spread over; lenses cast some light on it.
BLACK, SPREAD = 24.0, 8.0
# The share of the pixels outside the circles that are so; those of the circle's rim and of a maker's mark may not be.
MOST = 0.97
# A circle is taken larger than the square it touches, as lenses' circles are not centred to the pixel.
LARGER = 1.06
# Mean grey of what the circles show: a picture of the night is dark everywhere.
LIT = 40.0


def is_fisheye(image: np.ndarray) -> bool:
    """Whether a picture (h, w, 3) uint8 is of a fisheye lens, or of two side by side: its corners, outside a circle in each
    square, are black, and what is inside is not. A panorama's corners are sky and street."""
    grey = image.mean(axis=2)
    height, width = grey.shape
    circles = max(1, round(width / height))
    x = ((np.arange(width) + 0.5) * circles / width) % 1.0 - 0.5
    y = (np.arange(height) + 0.5) / height - 0.5
    outside = np.hypot(x, y[:, None]) > 0.5 * LARGER
    corners, shown = grey[outside], grey[~outside]
    if len(corners) == 0 or shown.mean() < LIT:
        return False
    black = (corners < BLACK) & (np.abs(corners - np.median(corners)) <= SPREAD)
    return bool(black.mean() >= MOST)
