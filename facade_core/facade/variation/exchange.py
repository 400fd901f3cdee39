"""Elements that may be exchanged: of one type, one row and one shape of the head."""

from __future__ import annotations

from collections.abc import Sequence

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
    arched = np.zeros(len(boxes), bool)
    for i, (x0, y0, x1, y1) in enumerate(boxes.tolist()):
        side = max(_MIN_CORNER_PX, round(_CORNER_SHARE * (x1 - x0)))
        top = y0 + 1, y0 + 1 + side
        third = (x1 - x0) // 3
        pane = _mean_colour(image, (y0 + 2 * side, min(y0 + 5 * side, y1)), (x0 + third, x1 - third))
        arched[i] = all(
            _is_wall(_mean_colour(image, top, corner), _mean_colour(image, top, outside), pane)
            for corner, outside in (
                ((x0 + 1, x0 + 1 + side), (x0 - 1 - side, x0 - 1)),
                ((x1 - 1 - side, x1 - 1), (x1 + 1, x1 + 1 + side)),
            )
        )
    return arched


def _is_wall(corner: Float64Array, wall: Float64Array, pane: Float64Array) -> bool:
    contrast = float(np.abs(pane - wall).max())
    return contrast >= _MIN_PANE_CONTRAST and float(np.abs(corner - wall).max()) <= _MAX_CORNER_CONTRAST * contrast


def _mean_colour(image: UInt8Array, rows: tuple[int, int], columns: tuple[int, int]) -> Float64Array:
    """Return the mean colour (3,) of a part; border pixels repeat beyond the image."""
    y = np.clip(np.arange(rows[0], max(rows[1], rows[0] + 1)), 0, image.shape[0] - 1)
    x = np.clip(np.arange(columns[0], max(columns[1], columns[0] + 1)), 0, image.shape[1] - 1)
    colour: Float64Array = image[y[:, None], x].mean(axis=(0, 1))
    return colour


def _number_rows(boxes: IntArray) -> Int64Array:
    """Return the (N,) row, from the top, of boxes (N, 4) of comparable size."""
    middle = (boxes[:, 1] + boxes[:, 3]) / 2
    order = np.argsort(middle, kind="stable")
    row = np.empty(len(boxes), int)
    row[order] = np.append(0, np.cumsum(np.diff(middle[order]) > _ROW_TOLERANCE * np.median(boxes[:, 3] - boxes[:, 1])))
    return row
