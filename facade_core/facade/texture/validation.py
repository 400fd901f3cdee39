"""Validation of images, labels and masks of the public functions of this package."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.errors import ImageError
from facade_core.facade.texture.settings import PICTURES


def check_exemplar_image(image: UInt8Array, *, min_side: int = PICTURES.min_side_px) -> None:
    """Raise ImageError unless image is uint8 RGB (H, W, 3) of at least `min_side` px a side."""
    if not isinstance(image, np.ndarray) or image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
        found = f"{getattr(image, 'dtype', type(image).__name__)} {getattr(image, 'shape', '')}"
        raise ImageError(f"texture: the image is {found}; pass uint8 RGB of shape (H, W, 3)")
    if min(image.shape[:2]) < min_side:
        raise ImageError(
            f"texture: the image is {image.shape[1]} x {image.shape[0]} px; pass one of at least {min_side} x {min_side} px"
        )


def check_exemplar_labels(image: UInt8Array, labels: UInt8Array) -> None:
    """Raise ImageError unless labels is uint8 (H, W) of the image's size, class ids or UNKNOWN."""
    from facade_core.parsing.validation import check_labels as check_ids

    if not isinstance(labels, np.ndarray) or labels.dtype != np.uint8 or labels.shape != image.shape[:2]:
        found = f"{getattr(labels, 'dtype', type(labels).__name__)} {getattr(labels, 'shape', '')}"
        raise ImageError(
            f"texture: the labels are {found}; pass uint8 class ids of shape {image.shape[:2]}, as parse(image) does"
        )
    check_ids(labels)


def check_mask(image: UInt8Array, mask: BoolArray) -> None:
    """Raise ImageError unless mask is bool (H, W) of the image's size and leaves some pixels known."""
    if not isinstance(mask, np.ndarray) or mask.dtype != bool or mask.shape != image.shape[:2]:
        found = f"{getattr(mask, 'dtype', type(mask).__name__)} {getattr(mask, 'shape', '')}"
        raise ImageError(f"inpaint: the mask is {found}; pass bool of shape {image.shape[:2]}, True = missing")
    if mask.all():
        raise ImageError(
            "inpaint: the mask covers the whole image; pass a mask with visible pixels, or retarget an exemplar"
        )
