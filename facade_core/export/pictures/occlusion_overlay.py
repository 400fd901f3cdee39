"""Pictures of occluders on a facade, and of the crop of a given picture."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.types import Box
from facade_core.export.pictures.settings import DRAWINGS


def overlay_occlusion(image: UInt8Array, hidden: BoolArray) -> UInt8Array:
    """Tint occluders red and pixelate them, so that no face or number plate is legible.

    Parameters
    ----------
    image : (h, w, 3) uint8.
    hidden : (h, w) bool, occluders.

    Returns
    -------
    (h, w, 3) uint8.
    """
    tinted = image.copy()
    tinted[hidden] = (0.45 * _mosaic(image)[hidden] + 0.55 * np.array([214, 52, 44])).astype(np.uint8)
    return tinted


def _mosaic(image: UInt8Array) -> UInt8Array:
    import cv2

    height, width = image.shape[:2]
    few = (max(1, width // DRAWINGS.mosaic_px), max(1, height // DRAWINGS.mosaic_px))
    coarse = cv2.resize(image, few, interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.resize(coarse, (width, height), interpolation=cv2.INTER_NEAREST), np.uint8)


def draw_crop_preview(image: UInt8Array, hidden: BoolArray, box: Box) -> UInt8Array:
    """Draw a given picture as a preview: dark and coarse outside of its crop, tinted where it was inpainted.

    Parameters
    ----------
    image : (h, w, 3) uint8.
    hidden : (h, w) bool over the crop, inpainted pixels.
    box : x0, y0, x1, y1 of the crop.
    """
    import cv2

    scale = min(1.0, DRAWINGS.max_preview_px / max(image.shape[:2]))
    height, width = (max(1, round(length * scale)) for length in image.shape[:2])
    small = np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
    x0, y0, x1, y1 = (round(at * scale) for at in box)
    x1, y1 = min(width, max(x1, x0 + 1)), min(height, max(y1, y0 + 1))
    tinted = cv2.resize(hidden.astype(np.uint8), (x1 - x0, y1 - y0), interpolation=cv2.INTER_NEAREST) == 1
    drawn = _mosaic(small) // 4
    drawn[y0:y1, x0:x1] = overlay_occlusion(small[y0:y1, x0:x1], tinted)
    return drawn
