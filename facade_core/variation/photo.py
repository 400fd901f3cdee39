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


def exchange_in_photo(image: np.ndarray, hierarchy: Hierarchy, level: int, seed: int) -> np.ndarray:
    """(H, W, 3) uint8: the image that the hierarchy codes, its elements exchanged as `Hierarchy.sample` does.

    The wall, and elements that stay where they are, keep their pixels. Raises ImageError for an image of another size,
    InputError for a level that there is not.
    """
    if image.shape != hierarchy.wall.shape:
        raise ImageError(
            f"image {image.shape}: the hierarchy codes {hierarchy.wall.shape}; pass the image that it codes"
        )
    shown = exchange(hierarchy.types_at(level), seed)
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
