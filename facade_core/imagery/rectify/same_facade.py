"""Test whether two rectified pictures show the same facade, by local features."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import Float32Array, UInt8Array
from facade_core.core.resizing import resize_image
from facade_core.imagery.rectify.settings import SAME_FACADE


class FacadeFeatures(NamedTuple):
    """Local features (SIFT) of a rectified picture.

    Attributes
    ----------
    places : (n, 2) pixels.
    descriptors : (n, 128).
    """

    places: Float32Array
    descriptors: Float32Array


def detect_facade_features(image: UInt8Array, metres_per_pixel: float) -> FacadeFeatures:
    """Detect the local features of a rectified picture (h, w, 3) at the density of comparison."""
    import cv2

    factor = metres_per_pixel * SAME_FACADE.feature_pixels_per_metre
    height, width = (max(16, round(side * factor)) for side in image.shape[:2])
    grey = cv2.cvtColor(np.ascontiguousarray(resize_image(image, (height, width))), cv2.COLOR_RGB2GRAY)
    points, descriptors = cv2.SIFT.create(nfeatures=SAME_FACADE.max_features).detectAndCompute(grey, None)
    if descriptors is None:
        return FacadeFeatures(np.zeros((0, 2), np.float32), np.zeros((0, 128), np.float32))
    return FacadeFeatures(np.array([point.pt for point in points], np.float32), np.asarray(descriptors, np.float32))


def show_same_facade(one: FacadeFeatures, other: FacadeFeatures) -> bool:
    """Return True if two rectified pictures show the same facade, or overlapping parts of one."""
    import cv2

    if min(len(one.places), len(other.places)) < SAME_FACADE.min_inliers:
        return False
    pairs = cv2.BFMatcher(cv2.NORM_L2).knnMatch(one.descriptors, other.descriptors, k=2)
    good = [
        pair[0]
        for pair in pairs
        if len(pair) == 2 and pair[0].distance < SAME_FACADE.max_distance_ratio * pair[1].distance
    ]
    if len(good) < SAME_FACADE.min_inliers:
        return False
    source = one.places[[match.queryIdx for match in good]]
    target = other.places[[match.trainIdx for match in good]]
    cv2.setRNGSeed(0)
    similarity, inliers = cv2.estimateAffinePartial2D(
        source, target, method=cv2.RANSAC, ransacReprojThreshold=SAME_FACADE.inlier_tolerance_px
    )
    if similarity is None:
        return False
    scale = float(np.hypot(similarity[0, 0], similarity[1, 0]))
    count = int(inliers.sum())
    return (
        count >= SAME_FACADE.min_inliers
        and count >= SAME_FACADE.min_inlier_share * len(good)
        and SAME_FACADE.min_scale <= scale <= SAME_FACADE.max_scale
        and abs(float(similarity[1, 0])) <= SAME_FACADE.max_turn * scale
    )
