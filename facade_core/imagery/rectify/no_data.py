"""Black corners that the warp of a rectified picture leaves."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, Int32Array, UInt8Array

# Largest value of the border that a warp leaves, also with JPEG ringing; facades are rarely so black.
BLACK_LEVEL = 14
# Smallest share of the picture of a black corner; smaller ones are shadows or frames.
MIN_CORNER_SHARE = 0.0005
# Its sides are straight to this share of the picture's longer side.
STRAIGHT_TOLERANCE = 0.008
# All its parts have at most this many sides,
MAX_SIDES = 16
# and the polygon matches the part by this IoU.
MIN_POLYGON_IOU = 0.9
# Or the part has one colour to this many levels (JPEG noise)
FLAT_NOISE = 2
# in this share of its pixels.
MIN_FLAT_SHARE = 0.99
# A dark part at the picture's foot that fills its box by this share is a gateway; a warp's corner tapers off.
MIN_GATEWAY_FILL = 0.8
# Pixels into which warp and compression mixed the border.
NO_DATA_RIM = 3


def no_data_mask(image: UInt8Array) -> BoolArray:
    """Mask the black corners of an image: flat black that is connected to a corner of the picture.

    Dark regions elsewhere at the border, and upright ones at the foot (gateways), belong to the content. A picture that
    is black as a whole has no corners.

    Parameters
    ----------
    image : (h, w, 3) uint8.

    Returns
    -------
    (h, w) bool.
    """
    import cv2

    red, green, blue = np.moveaxis(image, 2, 0)
    black = (np.maximum(np.maximum(red, green), blue) <= BLACK_LEVEL).astype(np.uint8)
    if black.all():
        return np.zeros(black.shape, bool)
    # opening: single pixels of a compressed edge must not connect a corner to a window
    solid = cv2.morphologyEx(black, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8), borderType=cv2.BORDER_REPLICATE)
    _, parts, stats, _ = cv2.connectedComponentsWithStats(solid, connectivity=4)
    corners = {int(part) for part in parts[[0, 0, -1, -1], [0, -1, 0, -1]]} - {0}
    corner_parts = [
        part
        for part in corners
        if stats[part, cv2.CC_STAT_AREA] >= MIN_CORNER_SHARE * black.size
        and not _is_gateway(stats[part], black.shape[0])
        and _is_warped(image, (parts == part).astype(np.uint8))
    ]
    is_corner = np.isin(parts, corner_parts).astype(np.uint8)
    return cv2.dilate(is_corner, np.ones((2 * NO_DATA_RIM + 1, 2 * NO_DATA_RIM + 1), np.uint8)).astype(bool)


def _is_gateway(stats: Int32Array, height: int) -> bool:
    _, top, wide, high, area = stats.tolist()
    is_gateway: bool = 0 < top == height - high and high > wide and area >= MIN_GATEWAY_FILL * wide * high
    return is_gateway


def _is_warped(image: UInt8Array, part: UInt8Array) -> bool:
    """Return True if a part (h, w) uint8 has few straight sides, or one colour, which no deep shadow has."""
    import cv2

    contours, _ = cv2.findContours(part, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    sides = [cv2.approxPolyDP(contour, STRAIGHT_TOLERANCE * max(part.shape), closed=True) for contour in contours]
    drawn = np.asarray(cv2.fillPoly(np.zeros_like(part), sides, 1), np.uint8)
    if sum(map(len, sides)) <= MAX_SIDES and (drawn & part).sum() >= MIN_POLYGON_IOU * (drawn | part).sum():
        return True
    inner = cv2.erode(part, np.ones((4 * NO_DATA_RIM + 1, 4 * NO_DATA_RIM + 1), np.uint8), borderValue=1).astype(bool)
    values = image[inner].max(axis=1).astype(np.int64)
    return values.size > 0 and bool((np.abs(values - np.median(values)) <= FLAT_NOISE).mean() >= MIN_FLAT_SHARE)
