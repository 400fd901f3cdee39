"""Occluder labels of facades whose class labels ignore occluders, for training and benchmarks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.labels import UNKNOWN, FacadeClass
from facade_core.core.types import Box
from training.datasets.facades import ANY_CLASS

# Height of the ground floor as a share of the labelled rows, without doors and shops,
_GROUND_SHARE = 0.25
# and at most.
_MAX_GROUND_SHARE = 0.4
# Margin around a box, as shares of its sides: wheels, bags and shadows reach beyond it.
_BOX_MARGIN = 0.12
# Twice green minus red and blue, of leaves.
_MIN_GREENNESS = 24
# Masks that fill less of their box have lost the object; an ellipse is closer to it.
_MIN_FILLED_SHARE = 0.35


def occluders_from_labels(
    image: UInt8Array,
    labels: UInt8Array,
    possible: UInt8Array,
    detected: Sequence[Box] | None,
    doubtful: Sequence[Box] = (),
) -> UInt8Array:
    """Derive the occluder labels of a facade from its class labels and detected boxes.

    Above the ground floor nothing is in front, except where leaves are possible. Detected objects are occluders. After
    a detection, labelled pixels of the ground floor are clear: its upper half except near a box of either kind, its
    lower half in columns that no box is near.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    labels : (H, W) uint8 class of each pixel.
    possible : (H, W) uint8, bit i set where class i is possible.
    detected : boxes of a detector, None without a detection.
    doubtful : boxes of possible objects.

    Returns
    -------
    (H, W) uint8: 1 occluder, 0 clear, UNKNOWN.
    """
    is_labelled = possible != ANY_CLASS
    if not is_labelled.any():
        return np.full(is_labelled.shape, UNKNOWN, np.uint8)
    top, bottom = ground_floor_rows(labels, possible)
    colours = image.astype(np.int16)
    leaves = ndimage.maximum_filter(2 * colours[..., 1] - colours[..., 0] - colours[..., 2] > _MIN_GREENNESS, 9)
    occluder = np.where(is_labelled & ~leaves, 0, UNKNOWN).astype(np.uint8)
    # Without a detector the whole ground floor is unknown.
    occluder[top if detected is None else bottom :] = UNKNOWN
    height, width = occluder.shape
    for box in (*(detected or ()), *doubtful):
        across, down = (round(_BOX_MARGIN * side) + 2 for side in (box[2] - box[0], box[3] - box[1]))
        columns = slice(max(0, box[0] - across), box[2] + across)
        occluder[max(0, box[1] - down) : box[3] + down, columns] = UNKNOWN
        # Shadows, wheels and neighbouring objects reach down to the ground.
        occluder[(top + bottom) // 2 :, columns] = UNKNOWN
    for box in detected or ():
        x0, y0, x1, y1 = np.clip(box, 0, (width, height, width, height)).tolist()
        if x1 - x0 > 2 and y1 - y0 > 2:
            occluder[y0:y1, x0:x1][_segment_object(image, (x0, y0, x1, y1))] = 1
    return occluder


def ground_floor_rows(labels: UInt8Array, possible: UInt8Array) -> tuple[int, int]:
    """Return the first row of the ground floor and the row below its last.

    Parameters
    ----------
    labels : (H, W) uint8; doors and shops in the lower part of the facade determine the ground floor.
    possible : (H, W) uint8, bit i set where class i is possible.
    """
    rows = np.flatnonzero((possible != ANY_CLASS).any(1))
    high, bottom = int(rows[0]), int(rows[-1]) + 1
    highest = bottom - round(_MAX_GROUND_SHARE * (bottom - high))
    is_street_level = (labels == FacadeClass.DOOR) | (labels == FacadeClass.SHOP)
    foot = highest + np.flatnonzero(is_street_level[highest:bottom].any(1))
    top = bottom - round(_GROUND_SHARE * (bottom - high))
    return (int(foot[0]) if foot.size else top), bottom


def _segment_object(image: UInt8Array, box: Box) -> BoolArray:
    """Mask (h, w) bool of the object in a box, by GrabCut (Rother et al. 2004) with background from around the box.

    An oval replaces a mask that has lost the object.
    """
    import cv2

    x0, y0, x1, y1 = box
    across, down = (max(4, (side + 1) // 3) for side in (x1 - x0, y1 - y0))
    left, up = max(0, x0 - across), max(0, y0 - down)
    surroundings = np.ascontiguousarray(image[up : y1 + down, left : x1 + across])
    trimap = np.full(surroundings.shape[:2], cv2.GC_BGD, np.uint8)
    inside = np.s_[y0 - up : y1 - up, x0 - left : x1 - left]
    trimap[inside] = cv2.GC_PR_FGD
    height, width = y1 - y0, x1 - x0
    y, x = np.mgrid[0:height, 0:width]
    oval = ((2 * x + 1) / width - 1) ** 4 + ((2 * y + 1) / height - 1) ** 4
    trimap[inside][oval < 0.1] = cv2.GC_FGD
    trimap[inside][oval > 1.5] = cv2.GC_BGD
    cv2.setRNGSeed(0)
    cv2.grabCut(surroundings, trimap, (0, 0, 0, 0), np.zeros((1, 65)), np.zeros((1, 65)), 3, cv2.GC_INIT_WITH_MASK)
    is_object = np.isin(trimap[inside], (cv2.GC_FGD, cv2.GC_PR_FGD))
    is_object = ndimage.binary_fill_holes(ndimage.binary_closing(np.pad(is_object, 5), iterations=3))[5:-5, 5:-5]
    segment: BoolArray = is_object if is_object.mean() >= _MIN_FILLED_SHARE else oval <= 1
    return segment
