"""What stands in front of labelled facades whose labels run straight on behind it, to teach and to measure a parser."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from facade_core.core.labels import UNKNOWN, FacadeClass
from facade_core.core.types import Box
from facade_core.parsing.training_views import ANY_CLASS

# The ground floor, as a share of the labelled rows: where no door or shop tells it, and at most.
_GROUND, _HIGHEST_GROUND = 0.25, 0.4
# Around a box not everything is wall yet: wheels, bags and shadows reach beyond it. Shares of its sides.
_MARGIN = 0.12
# Twice green less red and blue, of leaves.
_GREEN = 24
# A mask that fills less of its box than this has lost the thing; an ellipse is nearer to it.
_LEAST_FILLED = 0.35


def occluders_from_labels(
    image: np.ndarray,
    labels: np.ndarray,
    possible: np.ndarray,
    detected: Sequence[Box] | None,
    doubtful: Sequence[Box] = (),
) -> np.ndarray:
    """What can be said of a facade's occluders, (H, W) uint8: 1 in front, 0 nothing in front, UNKNOWN not told.

    image (H, W, 3) uint8; labels, possible (H, W) uint8, the class, and bit i where class i may be. found: boxes of a
    detector, None where none has looked; doubtful: of what may be something. Above the ground floor nothing is in front, but
    where leaves may be; what is in a box found is. Of the ground floor what is labelled is clear where a detector has looked:
    the upper half but near a box of either kind, the lower half in columns that none is near.
    """
    labelled = possible != ANY_CLASS
    if not labelled.any():
        return np.full(labelled.shape, UNKNOWN, np.uint8)
    top, bottom = ground_floor_rows(labels, possible)
    colours = image.astype(np.int16)
    leaves = ndimage.maximum_filter(2 * colours[..., 1] - colours[..., 0] - colours[..., 2] > _GREEN, 9)
    occluder = np.where(labelled & ~leaves, 0, UNKNOWN).astype(np.uint8)
    # Without a detector's look the whole ground floor is not told.
    occluder[top if detected is None else bottom :] = UNKNOWN
    height, width = occluder.shape
    for box in (*(detected or ()), *doubtful):
        across, down = (round(_MARGIN * side) + 2 for side in (box[2] - box[0], box[3] - box[1]))
        columns = slice(max(0, box[0] - across), box[2] + across)
        occluder[max(0, box[1] - down) : box[3] + down, columns] = UNKNOWN
        # Shadows, wheels and what else stands with it reach down to the ground.
        occluder[(top + bottom) // 2 :, columns] = UNKNOWN
    for box in detected or ():
        x0, y0, x1, y1 = np.clip(box, 0, (width, height, width, height)).tolist()
        if x1 - x0 > 2 and y1 - y0 > 2:
            occluder[y0:y1, x0:x1][_cut_out(image, (x0, y0, x1, y1))] = 1
    return occluder


def ground_floor_rows(labels: np.ndarray, possible: np.ndarray) -> tuple[int, int]:
    """First row of the ground floor and the row below its last, by doors and shops in the lower part of the facade."""
    rows = np.flatnonzero((possible != ANY_CLASS).any(1))
    high, bottom = int(rows[0]), int(rows[-1]) + 1
    highest = bottom - round(_HIGHEST_GROUND * (bottom - high))
    telling = (labels == FacadeClass.DOOR) | (labels == FacadeClass.SHOP)
    foot = highest + np.flatnonzero(telling[highest:bottom].any(1))
    top = bottom - round(_GROUND * (bottom - high))
    return (int(foot[0]) if foot.size else top), bottom


def _cut_out(image: np.ndarray, box: Box) -> np.ndarray:
    """The thing in a box of an image (H, W, 3) uint8, as a mask (h, w) bool of the box: GrabCut (Rother et al. 2004), which
    learns the colours of what is not the thing from around the box. Where it loses the thing, an oval stands for it."""
    import cv2

    x0, y0, x1, y1 = box
    across, down = (max(4, (side + 1) // 3) for side in (x1 - x0, y1 - y0))
    left, up = max(0, x0 - across), max(0, y0 - down)
    around = np.ascontiguousarray(image[up : y1 + down, left : x1 + across])
    told = np.full(around.shape[:2], cv2.GC_BGD, np.uint8)
    inside = np.s_[y0 - up : y1 - up, x0 - left : x1 - left]
    told[inside] = cv2.GC_PR_FGD
    height, width = y1 - y0, x1 - x0
    y, x = np.mgrid[0:height, 0:width]
    oval = ((2 * x + 1) / width - 1) ** 4 + ((2 * y + 1) / height - 1) ** 4
    told[inside][oval < 0.1] = cv2.GC_FGD
    told[inside][oval > 1.5] = cv2.GC_BGD
    cv2.setRNGSeed(0)
    cv2.grabCut(around, told, (0, 0, 0, 0), np.zeros((1, 65)), np.zeros((1, 65)), 3, cv2.GC_INIT_WITH_MASK)
    seen = np.isin(told[inside], (cv2.GC_FGD, cv2.GC_PR_FGD))
    seen = ndimage.binary_fill_holes(ndimage.binary_closing(np.pad(seen, 5), iterations=3))[5:-5, 5:-5]
    return seen if seen.mean() >= _LEAST_FILLED else oval <= 1
