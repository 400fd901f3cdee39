"""Permute the elements of a facade in its own pixels instead of a file's."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import UInt8Array
from facade_core.facade.variation.exchange import number_exchange_classes
from facade_core.facade.variation.rendering import element_boxes, paint_photo_elements
from facade_core.facade.variation.sampling import permute_within_types
from facade_core.facade.variation.variations import Variations


def permute_photo_elements(
    image: UInt8Array, variations: Variations, share: float, seed: int
) -> tuple[UInt8Array, Variations]:
    """Permute the elements of one type, row and head shape, and return the image with its variations.

    As `Hierarchy.sample`, in the image's own pixels. The wall, and elements that stay in place without a moved one
    behind them, keep their pixels.

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
    shown = permute_within_types(number_exchange_classes(image, variations.groups, types), seed)
    made = paint_photo_elements(
        image, image, variations.groups, np.arange(len(types)), element_boxes(variations.groups), shown
    )
    return made, variations.permute_elements(shown)
