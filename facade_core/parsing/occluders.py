"""Occluder masks of a facade: filtering and rims of the parser's mask."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray
from facade_core.core.types import Box

# Smaller occluders, as a share of the image, are ignored.
MIN_OCCLUDER_SHARE = 0.0005
# Rim around occluders as a share of the image's side: leaves and mirrors reach beyond a mask.
OCCLUDER_RIM_SHARE = 0.006
# The parser sees holes filled from their border and may take some of that border for an occluder. A part that
# reaches no farther than this share of the side from the hole is ignored.
MAX_SPILL_SHARE = 0.05


def clean_occluder_mask(occluded: BoolArray) -> tuple[BoolArray, tuple[Box, ...]]:
    """Remove specks from the parser's occluder mask, add a rim, and return its boxes too.

    Returns
    -------
    The mask, and the boxes of its parts.
    """
    from skimage.measure import label, regionprops

    parts = label(occluded)
    regions = [region for region in regionprops(parts) if region.area >= MIN_OCCLUDER_SHARE * occluded.size]
    mask = np.isin(parts, [region.label for region in regions])
    return dilate(mask, OCCLUDER_RIM_SHARE), tuple(
        (region.bbox[1], region.bbox[0], region.bbox[3], region.bbox[2]) for region in regions
    )


def remove_occluders_lining_hole(occluded: BoolArray, hidden: BoolArray) -> BoolArray:
    """Remove the parts of an occluder mask that stay within a narrow rim around a hole.

    A car that crosses the hole's border is no such part: it is kept up to there.

    Parameters
    ----------
    occluded : (h, w) bool occluders of the parser.
    hidden : (h, w) bool hole.
    """
    from skimage.measure import label

    parts = label(occluded & ~hidden)
    beyond = np.unique(parts[~dilate(hidden, MAX_SPILL_SHARE)])
    return np.isin(parts, beyond[beyond > 0])


def dilate(mask: BoolArray, share: float) -> BoolArray:
    """Dilate a mask (h, w) bool by a share of its side."""
    import cv2

    rim = 1 + round(share * np.sqrt(mask.size))
    return cv2.dilate(mask.astype(np.uint8), np.ones((2 * rim + 1, 2 * rim + 1), np.uint8)).astype(bool)
