"""Exchanging the elements of a facade as photographed, not as coded."""

from __future__ import annotations

import numpy as np

from facade_core.errors import ImageError
from facade_core.variation.hierarchy import Hierarchy
from facade_core.variation.patches import cut, patch_size
from facade_core.variation.rendering import back_to_front, blend
from facade_core.variation.sampling import exchange

# The percentile of a patch's values that stands for its brightest part.
BRIGHTEST = 99
# Elements whose middles are farther apart than this share of their height lie on different rows.
ROW = 0.35


def exchange_in_photo(image: np.ndarray, hierarchy: Hierarchy, level: int, seed: int) -> np.ndarray:
    """(H, W, 3) uint8: the image that the hierarchy codes, its elements exchanged as `Hierarchy.sample` does, but each within
    its row: another storey has other heads and sills, and what stands around an element stays.

    The wall, and elements that stay where they are, keep their pixels. Raises ImageError for an image of another size,
    InputError for a level that there is not.
    """
    if image.shape != hierarchy.wall.shape:
        raise ImageError(
            f"image {image.shape}: the hierarchy codes {hierarchy.wall.shape}; pass the image that it codes"
        )
    types = hierarchy.types_at(level)
    row = np.concatenate([_rows(group.boxes) for group in hierarchy.groups]) if hierarchy.groups else types
    shown = exchange(types * (len(types) + 1) + row, seed)
    canvas = image.astype(np.float32)
    for group, first in back_to_front(hierarchy.groups):
        number = len(group.boxes)
        source = shown[first : first + number] - first
        patches = cut(image, group.boxes, patch_size(group.boxes))
        # What is beside an element may be another wall, in no other light: lit for it, white frames would burn out. So none is
        # made brighter than what stood there.
        brightest = np.maximum(1, np.percentile(patches, BRIGHTEST, axis=(1, 2, 3)))
        most = np.maximum(1, brightest / brightest[source])
        lit = np.minimum(group.light / group.light[source], most).astype(np.float32)
        for i in np.flatnonzero(source != np.arange(number)):
            blend(canvas, patches[source[i]] * lit[i], group.boxes[i].tolist())
    return np.clip(canvas.round(), 0, 255).astype(np.uint8)


def _rows(boxes: np.ndarray) -> np.ndarray:
    """The row (N,) int of each of some boxes (N, 4) of comparable size, from the top."""
    middle = (boxes[:, 1] + boxes[:, 3]) / 2
    order = np.argsort(middle, kind="stable")
    row = np.empty(len(boxes), int)
    row[order] = np.append(0, np.cumsum(np.diff(middle[order]) > ROW * np.median(boxes[:, 3] - boxes[:, 1])))
    return row
