"""Exchanging the elements of a facade in its own pixels, not in a file's."""

from __future__ import annotations

import numpy as np

from facade_core.facade.variation.rendering import element_boxes, paint_elements
from facade_core.facade.variation.sampling import exchange
from facade_core.facade.variation.variations import Variations

# Elements whose middles are farther apart than this share of their height lie on different rows.
ROW = 0.35


def exchange_in_photo(image: np.ndarray, of: Variations, share: float, seed: int) -> tuple[np.ndarray, Variations]:
    """The image (H, W, 3) uint8 with elements of one type at this share of its levels exchanged as `Hierarchy.sample` does, but
    each within its row: another storey has other heads and sills, and what stands around an element stays. And the variations
    of that image.

    The wall, and elements that stay where they are and before which none moved, keep their pixels. Raises InputError for a
    negative seed.
    """
    types = of.types_at(round(share * (len(of.levels) - 1)))
    row = np.concatenate([_rows(group.boxes) for group in of.groups]) if of.groups else types
    shown = exchange(types * (len(types) + 1) + row, seed)
    made = paint_elements(image, image, of.groups, np.arange(len(types)), element_boxes(of.groups), shown)
    return made, of.exchanged(shown)


def _rows(boxes: np.ndarray) -> np.ndarray:
    """The row (N,) int of each of some boxes (N, 4) of comparable size, from the top."""
    middle = (boxes[:, 1] + boxes[:, 3]) / 2
    order = np.argsort(middle, kind="stable")
    row = np.empty(len(boxes), int)
    row[order] = np.append(0, np.cumsum(np.diff(middle[order]) > ROW * np.median(boxes[:, 3] - boxes[:, 1])))
    return row
