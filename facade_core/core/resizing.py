"""Resizing of images and label maps."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import UInt8Array


def resize_image(image: UInt8Array, size: tuple[int, int]) -> UInt8Array:
    """Resize an image (h, w, ...) to (height, width): by area means where it gets smaller, else bicubic."""
    import cv2

    if image.shape[:2] == size:
        return image
    smaller = size[0] * size[1] < image.shape[0] * image.shape[1]
    return np.asarray(
        cv2.resize(image, size[::-1], interpolation=cv2.INTER_AREA if smaller else cv2.INTER_CUBIC), np.uint8
    )


def resize_with_labels(image: UInt8Array, labels: UInt8Array, size: tuple[int, int]) -> tuple[UInt8Array, UInt8Array]:
    """Resize an image (h, w, 3) and its labels (h, w) to (height, width)."""
    import cv2

    resized = cv2.resize(labels, size[::-1], interpolation=cv2.INTER_NEAREST)
    return resize_image(image, size), np.asarray(resized, np.uint8)
