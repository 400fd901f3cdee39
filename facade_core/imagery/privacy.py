"""Privacy of stored evidence: people and number plates in front of facades."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.types import Privacy

# Side in metres of the squares over which a blurred occluder is averaged: about three faces or one plate.
BLUR_CELL_M = 0.5


def apply_privacy(evidence: UInt8Array, hidden: BoolArray, privacy: Privacy, texels_per_metre: float) -> UInt8Array:
    """Keep, mask or blur the hidden texels of a facade's evidence.

    A blurred texel has the mean colour of all hidden texels of its square. Visible texels contribute nothing and stay
    unchanged, so that nothing but these means remains of an occluder.

    Parameters
    ----------
    evidence : (h, w, 3) uint8.
    hidden : (h, w) bool, texels that an occluder hides.
    privacy : "keep", "mask" or "blur".
    texels_per_metre : density of the raster.

    Returns
    -------
    (h, w, 3) uint8; the input itself where nothing changes.
    """
    if privacy == "keep" or not hidden.any():
        return evidence
    result = evidence.copy()
    if privacy == "mask":
        result[hidden] = np.rint(evidence[hidden].mean(axis=0))
        return result
    height, width = hidden.shape
    cell = max(2, round(BLUR_CELL_M * texels_per_metre))
    square = (np.arange(height) // cell)[:, None] * -(-width // cell) + (np.arange(width) // cell)[None]
    hidden_squares = square[hidden]
    count = np.maximum(1, np.bincount(hidden_squares))
    for channel in range(3):
        mean = np.bincount(hidden_squares, evidence[..., channel][hidden]) / count
        result[..., channel][hidden] = np.rint(mean)[hidden_squares]
    return result
