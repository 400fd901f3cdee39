"""Encoding a facade image by the variations of its elements (AlSisan & Mitra 2012)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.core.errors import ImageError
from facade_core.core.types import Element
from facade_core.facade.variation.codec import encode_file
from facade_core.facade.variation.hierarchy import Hierarchy
from facade_core.facade.variation.variations import Variations, find_variations

# Pixels of a side that a file of a facade has at most.
_MAX_SIDE_PX = 16383


def encode(image: np.ndarray, elements: Sequence[Element], *, seed: int = 0) -> Hierarchy:
    """The variation-factored hierarchy of a rectified facade.

    image (H, W, 3) uint8; elements in its pixels, clipped to it; those under 3 px stay part of the wall, exact
    duplicates count once. Their types (`variations`) on the repetition grids make the structure
    matrices S0, which ICM on Eq. 1 makes ever more regular, up to one type per grid. A level is a set of matrices that
    differs from the one before by more than names. No element: one level, the wall.

    Nothing is random, so `seed` changes nothing. Raises ImageError for another kind of array, LayoutError for elements
    without area, of an unknown label or outside the image.
    """
    _check_photo(image)
    return encode_variations(image, find_variations(image, elements))


def encode_variations(image: np.ndarray, variations: Variations) -> Hierarchy:
    """The hierarchy of a facade whose variations are known. Raises ImageError for another kind of array."""
    _check_photo(image)
    return Hierarchy.from_bytes(
        encode_file(image, variations.groups, variations.cells, variations.representatives, variations.levels)
    )


def _check_photo(image: np.ndarray) -> None:
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3 or 0 in image.shape:
        raise ImageError(f"facade image: need a (H, W, 3) uint8 array, not {image.shape} {image.dtype}")
    if max(image.shape) > _MAX_SIDE_PX:
        raise ImageError(
            f"facade image: {image.shape[1]} x {image.shape[0]} px, at most {_MAX_SIDE_PX} a side; downsample it"
        )
