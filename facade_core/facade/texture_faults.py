"""Measures of what is wrong with a finished texture: objects left in it, large inpainted parts, and parts that parse badly."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array
from facade_core.core.labels import FacadeClass
from facade_core.parsing.segmentation import Segmentation


def foreign_share(segmentation: Segmentation) -> float:
    """Compute the share of a finished texture that is an occluder, sky, street or a neighbour, more likely than not."""
    is_sky = segmentation.confidence.argmax(axis=2) == FacadeClass.SKY
    return float((is_sky | (segmentation.occluder >= 0.5) | (segmentation.outside >= 0.5)).mean())


def inpainting_doubt(confidence: Float32Array, inpainted: BoolArray) -> float:
    """Compute the mean doubt of the parse of a finished texture in its inpainted part; 0 without one.

    Parameters
    ----------
    confidence : (h, w, 7) probability of each class.
    inpainted : (h, w) bool.
    """
    return float(1 - confidence.max(axis=2)[inpainted].mean()) if inpainted.any() else 0.0


def inpainted_radius(inpainted: BoolArray) -> float:
    """Compute the radius of the largest circle on a wall that is inpainted throughout, in pixels; inpainted: (h, w) bool."""
    import cv2

    return float(cv2.distanceTransform(np.pad(inpainted.astype(np.uint8), 1), cv2.DIST_L2, cv2.DIST_MASK_PRECISE).max())
