"""Removal of colour fringes of lenses and of coarse chroma, by guided filtering of chroma with luminance."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Float32Array, UInt8Array

# Radius of the filter's window in pixels: fringes of stitched panoramas are one to three pixels wide.
RADIUS_PIXELS = 4
# Variance of luminance, in grey levels squared, below which chroma is smoothed rather than bound to luminance.
SMOOTHING_VARIANCE = 36.0
# Rows filtered at once, which bounds memory.
BAND_ROWS = 256


def remove_colour_fringes(image: UInt8Array) -> UInt8Array:
    """Bind the chroma of a picture to its luminance, which stays: edges lose coloured fringes, areas keep their colours.

    Chroma becomes a linear function of luminance in each window (guided filter). A fringe has one hue on one side of an
    edge and another on the other side, which no such function has.

    Parameters
    ----------
    image : (h, w, 3) uint8 RGB.

    Returns
    -------
    (h, w, 3) uint8.

    References
    ----------
    He, Sun & Tang (2013), Guided image filtering, eq. 5 to 8.
    """
    import cv2

    out = np.empty_like(image)
    margin = 2 * RADIUS_PIXELS
    for top in range(0, len(image), BAND_ROWS):
        first, last = max(0, top - margin), min(len(image), top + BAND_ROWS + margin)
        colour = np.asarray(cv2.cvtColor(image[first:last], cv2.COLOR_RGB2YCrCb))
        guide = colour[..., 0].astype(np.float32)
        mean, spread = _box_mean(guide), _box_mean(guide * guide)
        spread -= mean * mean
        for channel in (1, 2):
            chroma = colour[..., channel].astype(np.float32)
            average = _box_mean(chroma)
            slope = (_box_mean(guide * chroma) - mean * average) / (spread + SMOOTHING_VARIANCE)
            offset = average - slope * mean
            bound = _box_mean(slope) * guide + _box_mean(offset)
            colour[..., channel] = np.clip(np.rint(bound), 0, 255).astype(np.uint8)
        band = slice(top, min(top + BAND_ROWS, len(image)))
        out[band] = cv2.cvtColor(colour, cv2.COLOR_YCrCb2RGB)[top - first : band.stop - first]
    return out


def _box_mean(values: Float32Array) -> Float32Array:
    import cv2

    side = 2 * RADIUS_PIXELS + 1
    return np.asarray(cv2.blur(values, (side, side), borderType=cv2.BORDER_REFLECT), np.float32)
