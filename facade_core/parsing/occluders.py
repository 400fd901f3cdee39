"""What stands in front of a facade, as masks: what counts of what the parser sees, and how far it reaches."""

from __future__ import annotations

import numpy as np

from facade_core.core.types import Box

# What the parser sees in front of a facade counts from this share of the image on, and hides a rim of this share of
# its side more: leaves and mirrors reach beyond what a mask holds.
LEAST_THING, OCCLUDER_RIM_SHARE = 0.0005, 0.006
# The parser, which sees a hole filled from its border, takes some of that border for a thing: what reaches no farther than
# this share from the hole is none.
SPILL = 0.05


def occluder_mask(occluded: np.ndarray) -> tuple[np.ndarray, tuple[Box, ...]]:
    """The parser's mask (h, w) bool of what stands in front, without specks and with a rim; and the boxes of its parts."""
    from skimage.measure import label, regionprops

    parts = label(occluded)
    things = [thing for thing in regionprops(parts) if thing.area >= LEAST_THING * occluded.size]
    kept = np.isin(parts, [thing.label for thing in things])
    return dilate(kept, OCCLUDER_RIM_SHARE), tuple(
        (thing.bbox[1], thing.bbox[0], thing.bbox[3], thing.bbox[2]) for thing in things
    )


def remove_spill(occluded: np.ndarray, hidden: np.ndarray) -> np.ndarray:
    """What the parser takes for in front (h, w) bool, without the parts that only line a hole (h, w) bool. A car that the
    hole's border crosses is no such part: it is believed up to there."""
    from skimage.measure import label

    parts = label(occluded & ~hidden)
    beyond = np.unique(parts[~dilate(hidden, SPILL)])
    return np.isin(parts, beyond[beyond > 0])


def dilate(mask: np.ndarray, share: float) -> np.ndarray:
    """A mask (h, w) bool and a rim of this share of its side around it."""
    import cv2

    rim = 1 + round(share * np.sqrt(mask.size))
    return cv2.dilate(mask.astype(np.uint8), np.ones((2 * rim + 1, 2 * rim + 1), np.uint8)).astype(bool)
