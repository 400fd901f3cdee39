"""Elements that may be exchanged: of one type, one row and one shape of the head."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, Int64Array, IntArray, UInt8Array
from facade_core.facade.variation.contents import ElementGroup
from facade_core.facade.variation.rendering import element_boxes

# Largest distance between centres of one row, as a share of the height.
_ROW_TOLERANCE = 0.35
# Side of an upper corner that an arch leaves free, as a share of the width; at least so many pixels.
_CORNER_SHARE = 0.1
_MIN_CORNER_PX = 2
# Largest difference of an upper corner from the wall beside it, as a share of the difference of the pane from that wall.
_MAX_CORNER_CONTRAST = 0.4
# Smallest difference of the pane from the wall, grey levels.
_MIN_PANE_CONTRAST = 20.0


def number_exchange_classes(image: UInt8Array, groups: Sequence[ElementGroup], types: IntArray) -> Int64Array:
    """Assign each element a class; elements of one class may take each other's place.

    Sills and surrounds belong to the wall and differ between floors, and an arched head does not fill a straight
    surround. So the elements of a class share type, row and shape of the head.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    groups : elements by label and size.
    types : (N,) type of each element; a type is of one group.

    Returns
    -------
    (N,) int.
    """
    if not groups:
        return np.asarray(types, np.int64)
    row = np.concatenate([_number_rows(group.boxes) for group in groups])
    arched = find_arched_heads(image, element_boxes(groups))
    number: Int64Array = np.unique(np.stack([types, row, arched]), axis=1, return_inverse=True)[1].reshape(-1)
    return number


def find_arched_heads(image: UInt8Array, boxes: IntArray) -> BoolArray:
    """Find elements whose two upper corners show the wall beside them, unlike their middle.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    boxes : (N, 4) pixels.

    Returns
    -------
    (N,) bool.
    """
    if not len(boxes):
        return np.zeros(0, bool)
    x0, y0, x1, y1 = np.asarray(boxes, np.int64).T
    side = np.maximum(_MIN_CORNER_PX, np.rint(_CORNER_SHARE * (x1 - x0)).astype(np.int64))
    third = (x1 - x0) // 3
    margin = 5 * int(side.max())
    # Border pixels repeat beyond the image. Sums of whole numbers are exact in any order.
    sums = cv2.integral(cv2.copyMakeBorder(image, margin, margin, margin, margin, cv2.BORDER_REPLICATE))

    def mean_colour(top: Int64Array, bottom: Int64Array, left: Int64Array, right: Int64Array) -> Float64Array:
        """Return the mean colour (N, 3) of a part of each element, of at least a row and a column."""
        high, wide = np.maximum(bottom - top, 1), np.maximum(right - left, 1)
        y, x = top + margin, left + margin
        total = sums[y + high, x + wide] - sums[y, x + wide] - sums[y + high, x] + sums[y, x]
        colour: Float64Array = total / (high * wide)[:, None]
        return colour

    pane = mean_colour(y0 + 2 * side, np.minimum(y0 + 5 * side, y1), x0 + third, x1 - third)
    top = y0 + 1, y0 + 1 + side
    left = _is_wall(mean_colour(*top, x0 + 1, x0 + 1 + side), mean_colour(*top, x0 - 1 - side, x0 - 1), pane)
    return left & _is_wall(mean_colour(*top, x1 - 1 - side, x1 - 1), mean_colour(*top, x1 + 1, x1 + 1 + side), pane)


def _is_wall(corner: Float64Array, wall: Float64Array, pane: Float64Array) -> BoolArray:
    """Report (N,) whether corners have the colour of the wall beside them; all (N, 3)."""
    contrast = np.abs(pane - wall).max(axis=1)
    return np.asarray(
        (contrast >= _MIN_PANE_CONTRAST) & (np.abs(corner - wall).max(axis=1) <= _MAX_CORNER_CONTRAST * contrast)
    )


def _number_rows(boxes: IntArray) -> Int64Array:
    """Return the (N,) row, from the top, of boxes (N, 4) of comparable size."""
    middle = (boxes[:, 1] + boxes[:, 3]) / 2
    order = np.argsort(middle, kind="stable")
    row = np.empty(len(boxes), int)
    row[order] = np.append(0, np.cumsum(np.diff(middle[order]) > _ROW_TOLERANCE * np.median(boxes[:, 3] - boxes[:, 1])))
    return row
