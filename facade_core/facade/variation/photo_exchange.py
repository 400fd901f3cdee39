"""Exchanging the elements of a facade in its own pixels, not in a file's."""

from __future__ import annotations

import numpy as np

from facade_core.facade.variation.rendering import element_boxes, paint_elements
from facade_core.facade.variation.sampling import permute_within_types
from facade_core.facade.variation.variations import Variations

# Elements whose middles are farther apart than this share of their height lie on different rows.
ROW_TOLERANCE = 0.35


def exchange_in_photo(
    image: np.ndarray, variations: Variations, share: float, seed: int
) -> tuple[np.ndarray, Variations]:
    """The image (H, W, 3) uint8 with elements of one type at this share of its levels exchanged as `Hierarchy.sample` does, but
    each within its row: another storey has other heads and sills, and what stands around an element stays. And the variations
    of that image.

    The wall, and elements that stay where they are and before which none moved, keep their pixels. Raises InputError for a
    negative seed.
    """
    types = variations.types_at(round(share * (len(variations.levels) - 1)))
    row = np.concatenate([_row_numbers(group.boxes) for group in variations.groups]) if variations.groups else types
    shown = permute_within_types(types * (len(types) + 1) + row, seed)
    made = paint_elements(
        image, image, variations.groups, np.arange(len(types)), element_boxes(variations.groups), shown
    )
    return made, variations.permute_elements(shown)


def _row_numbers(boxes: np.ndarray) -> np.ndarray:
    """The row (N,) int of each of some boxes (N, 4) of comparable size, from the top."""
    middle = (boxes[:, 1] + boxes[:, 3]) / 2
    order = np.argsort(middle, kind="stable")
    row = np.empty(len(boxes), int)
    row[order] = np.append(0, np.cumsum(np.diff(middle[order]) > ROW_TOLERANCE * np.median(boxes[:, 3] - boxes[:, 1])))
    return row
