"""Test whether two rectified pictures show the same facade, by local features."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import Float32Array, UInt8Array
from facade_core.core.resizing import resize_image

# Density at which features are found: scales from storeys differ by less than what features bear.
FEATURE_PIXELS_PER_METRE = 16.0
MAX_FEATURES = 600
# Lowe's ratio of the nearest and the second nearest feature. Repeated windows are ambiguous and drop out.
MAX_DISTANCE_RATIO = 0.75
# Matches that one shift and scale must explain, and their share of all matches.
MIN_INLIERS = 14
MIN_INLIER_SHARE = 0.35
# Pixels by which an inlier may be off.
INLIER_TOLERANCE_PX = 4.0
# Scales between two pictures of one facade, and their greatest turn as a sine.
MIN_SCALE = 0.5
MAX_SCALE = 2.0
MAX_TURN = 0.05


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

    factor = metres_per_pixel * FEATURE_PIXELS_PER_METRE
    height, width = (max(16, round(side * factor)) for side in image.shape[:2])
    grey = cv2.cvtColor(np.ascontiguousarray(resize_image(image, (height, width))), cv2.COLOR_RGB2GRAY)
    points, descriptors = cv2.SIFT.create(nfeatures=MAX_FEATURES).detectAndCompute(grey, None)
    if descriptors is None:
        return FacadeFeatures(np.zeros((0, 2), np.float32), np.zeros((0, 128), np.float32))
    return FacadeFeatures(np.array([point.pt for point in points], np.float32), np.asarray(descriptors, np.float32))


def show_same_facade(one: FacadeFeatures, other: FacadeFeatures) -> bool:
    """Return True if two rectified pictures show the same facade, or overlapping parts of one."""
    import cv2

    if min(len(one.places), len(other.places)) < MIN_INLIERS:
        return False
    pairs = cv2.BFMatcher(cv2.NORM_L2).knnMatch(one.descriptors, other.descriptors, k=2)
    good = [pair[0] for pair in pairs if len(pair) == 2 and pair[0].distance < MAX_DISTANCE_RATIO * pair[1].distance]
    if len(good) < MIN_INLIERS:
        return False
    source = one.places[[match.queryIdx for match in good]]
    target = other.places[[match.trainIdx for match in good]]
    cv2.setRNGSeed(0)
    similarity, inliers = cv2.estimateAffinePartial2D(
        source, target, method=cv2.RANSAC, ransacReprojThreshold=INLIER_TOLERANCE_PX
    )
    if similarity is None:
        return False
    scale = float(np.hypot(similarity[0, 0], similarity[1, 0]))
    count = int(inliers.sum())
    return (
        count >= MIN_INLIERS
        and count >= MIN_INLIER_SHARE * len(good)
        and MIN_SCALE <= scale <= MAX_SCALE
        and abs(float(similarity[1, 0])) <= MAX_TURN * scale
    )
