"""Validation of images and label maps."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.labels import CLASSES, UNKNOWN


def check_image(image: UInt8Array) -> None:
    """Raise ImageError unless an image is uint8, (H, W, 3) RGB or (H, W, 4) RGBA, with at least one pixel."""
    if not isinstance(image, np.ndarray):
        raise ImageError(
            f"image: expected a numpy array, got {type(image).__name__}; read the file into an array first"
        )
    if image.dtype != np.uint8:
        raise ImageError(f"image: expected uint8, got {image.dtype}; scale it to 0..255 and convert it to uint8")
    if image.ndim != 3 or image.shape[2] not in (3, 4):
        raise ImageError(f"image: expected (H, W, 3) RGB or (H, W, 4) RGBA, got shape {image.shape}; convert it to RGB")
    if image.size == 0:
        raise ImageError(f"image: no pixels in shape {image.shape}; check the crop that it comes from")


def check_labels(labels: UInt8Array) -> None:
    """Raise ImageError unless labels are (H, W) uint8 class ids or UNKNOWN, with at least one pixel."""
    if not isinstance(labels, np.ndarray) or labels.dtype != np.uint8:
        kind = labels.dtype if isinstance(labels, np.ndarray) else type(labels).__name__
        raise ImageError(f"labels: expected a uint8 array, got {kind}; convert the class ids with astype(np.uint8)")
    if labels.ndim != 2 or labels.size == 0:
        raise ImageError(f"labels: expected (H, W), at least one pixel, got shape {labels.shape}; pass one label map")
    strange = labels[(labels >= len(CLASSES)) & (labels != UNKNOWN)]
    if strange.size:
        raise ImageError(f"labels: id {strange[0]} is no class; map the ids to 0..{len(CLASSES) - 1} or {UNKNOWN}")
