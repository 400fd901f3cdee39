"""What stood in front of facades, people and number plates with it, in the evidence that is kept."""

from __future__ import annotations

import numpy as np

from facade_core.core.types import Privacy

# Side in metres of the squares that a blurred thing is averaged over: some three faces wide, a plate long.
BLUR_CELL_M = 0.5


def apply_privacy(evidence: np.ndarray, hidden: np.ndarray, privacy: Privacy, texels_per_metre: float) -> np.ndarray:
    """The evidence (h, w, 3) uint8 of a facade, with what hides it (h, w) bool as `privacy` says.

    A blurred place has the mean colour of all hidden texels in its square, not of its neighbours: nothing of a thing remains
    but these, and nothing of the facade beside it is touched.
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
    there = square[hidden]
    count = np.maximum(1, np.bincount(there))
    for channel in range(3):
        mean = np.bincount(there, evidence[..., channel][hidden]) / count
        result[..., channel][hidden] = np.rint(mean)[there]
    return result
