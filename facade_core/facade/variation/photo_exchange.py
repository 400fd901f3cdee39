"""Permute the elements of a facade in its own pixels instead of a file's."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Int64Array, IntArray, UInt8Array
from facade_core.facade.variation.rendering import element_boxes, paint_photo_elements
from facade_core.facade.variation.sampling import permute_within_types
from facade_core.facade.variation.variations import Variations

# Largest distance between centres of one row, as a share of the height.
ROW_TOLERANCE = 0.35


def permute_photo_elements(
    image: UInt8Array, variations: Variations, share: float, seed: int
) -> tuple[UInt8Array, Variations]:
    """Permute the elements of one type within their row, and return the image with its variations.

    As `Hierarchy.sample`, but within rows, since heads and sills differ between floors. The wall, and elements that
    stay in place without a moved one behind them, keep their pixels.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    variations : variations of the image.
    share : level, as a share of the last one, whose types are permuted.
    seed : number of the permutation, from 0.

    Raises
    ------
    InputError
        For a negative seed.
    """
    types = variations.types_at(round(share * (len(variations.levels) - 1)))
    row = np.concatenate([_row_numbers(group.boxes) for group in variations.groups]) if variations.groups else types
    shown = permute_within_types(types * (len(types) + 1) + row, seed)
    made = paint_photo_elements(
        image, image, variations.groups, np.arange(len(types)), element_boxes(variations.groups), shown
    )
    return made, variations.permute_elements(shown)


def _row_numbers(boxes: IntArray) -> Int64Array:
    """Return the (N,) row, from the top, of boxes (N, 4) of comparable size."""
    middle = (boxes[:, 1] + boxes[:, 3]) / 2
    order = np.argsort(middle, kind="stable")
    row = np.empty(len(boxes), int)
    row[order] = np.append(0, np.cumsum(np.diff(middle[order]) > ROW_TOLERANCE * np.median(boxes[:, 3] - boxes[:, 1])))
    return row
