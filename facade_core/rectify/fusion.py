"""One raster of a chart from several."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

# Gains beyond these say that two pictures do not show the same thing.
GAIN = (0.5, 2.0)
# Texels below which an overlap says nothing of the exposure.
LEAST_OVERLAP = 256
# Clipped texels say nothing of it either.
EXPOSED = (8, 247)
# Texels over which one picture fades into the next.
FADE = 12


def fuse(views: Sequence[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """Rasters of one chart, best first, each rgb (h, w, 3) uint8 and seen (h, w) bool, into one of the same form.

    The first keeps its texels but for a narrow fade at its border; each next fills what is left, its channels matched to the
    texels it shares with what is there.
    """
    import cv2

    rgb, seen = views[0][0].copy(), views[0][1].copy()
    for colour, more in views[1:]:
        fresh = more & ~seen
        if not fresh.any():
            continue
        gained = np.clip(colour * _gain(rgb, colour, seen & more), 0, 255)
        if seen.any():
            into = cv2.distanceTransform((~fresh).astype(np.uint8), cv2.DIST_L2, 3)
            fading = seen & more & (into < FADE)
            share = (into[fading] / FADE)[:, None]
            rgb[fading] = np.round(share * rgb[fading] + (1 - share) * gained[fading])
        rgb[fresh] = np.round(gained[fresh])
        seen |= more
    return rgb, seen


def _gain(rgb: np.ndarray, colour: np.ndarray, shared: np.ndarray) -> np.ndarray:
    """Factors (3,) float32 that bring `colour` to the exposure of `rgb` over the texels they share."""
    a, b = rgb[shared], colour[shared]
    low, high = EXPOSED
    usable = ((a >= low) & (a <= high) & (b >= low) & (b <= high)).all(axis=1)
    if usable.sum() < LEAST_OVERLAP:
        return np.ones(3, np.float32)
    return np.clip(a[usable].mean(axis=0) / b[usable].mean(axis=0), *GAIN).astype(np.float32)
