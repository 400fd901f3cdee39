"""Encode a facade image by the variations of its elements (AlSisan & Mitra 2012)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.core.arrays import UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.types import Element
from facade_core.facade.variation.codec import encode_hierarchy_file
from facade_core.facade.variation.hierarchy import Hierarchy
from facade_core.facade.variation.variations import Variations, find_variations

# Longest side of the photo in a file.
_MAX_SIDE_PX = 16383


def encode(image: UInt8Array, elements: Sequence[Element], *, seed: int = 0) -> Hierarchy:
    """Encode a rectified facade as a variation-factored hierarchy.

    The types of its elements on the repetition grids form the structure matrices S0, which ICM on Eq. 1 makes more
    and more regular, up to one type per grid. A level is a set of matrices that differs from the previous one by more
    than names. Without elements there is one level, the wall.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    elements : in pixels, clipped to the image. Those under 3 px remain part of the wall, exact duplicates count once.
    seed : without effect; nothing is random.

    Raises
    ------
    ImageError
        For another kind of array.
    LayoutError
        For elements without area, of an unknown label or outside the image.
    """
    _check_photo(image)
    return encode_variations(image, find_variations(image, elements))


def encode_variations(image: UInt8Array, variations: Variations) -> Hierarchy:
    """Encode a facade whose variations are known.

    Raises
    ------
    ImageError
        For another kind of array.
    """
    _check_photo(image)
    return Hierarchy.from_bytes(
        encode_hierarchy_file(image, variations.groups, variations.cells, variations.representatives, variations.levels)
    )


def _check_photo(image: UInt8Array) -> None:
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3 or 0 in image.shape:
        raise ImageError(f"facade image: need a (H, W, 3) uint8 array, not {image.shape} {image.dtype}")
    if max(image.shape) > _MAX_SIDE_PX:
        raise ImageError(
            f"facade image: {image.shape[1]} x {image.shape[0]} px, at most {_MAX_SIDE_PX} a side; downsample it"
        )
