"""Pictures at another size."""

from __future__ import annotations

import numpy as np


def resized(image: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """An image (h, w, ...) uint8 at size = (height, width): by the means of its pixels where that is smaller, else smoothly."""
    import cv2

    if image.shape[:2] == size:
        return image
    smaller = size[0] * size[1] < image.shape[0] * image.shape[1]
    return cv2.resize(image, size[::-1], interpolation=cv2.INTER_AREA if smaller else cv2.INTER_CUBIC)


def resized_with_labels(image: np.ndarray, labels: np.ndarray, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """An image (h, w, 3) uint8 and its labels (h, w) uint8 at size = (height, width)."""
    import cv2

    return resized(image, size), cv2.resize(labels, size[::-1], interpolation=cv2.INTER_NEAREST)
