"""What a rectified picture does not show: the black corners that its warp left."""

from __future__ import annotations

import numpy as np

# No value of the border that a warp leaves is above this, also where a JPEG has rung; seldom is a part of a facade so black.
BLACK = 14
# A black corner has at least this share of the picture, else it is a shadow or a frame of a few pixels.
LEAST = 0.0005
# Its sides are straight to this share of the picture's longer side, all corners together have so many at most, and what these
# enclose is alike. Or it is of one colour but for the noise of a JPEG.
STRAIGHT, MOST_SIDES, ALIKE = 0.008, 16, 0.9
NOISE, FLAT = 2, 0.99
# What stands upright at the picture's foot and fills its box so far is a gateway; a corner that a warp left there tapers off.
MOST_FILLED = 0.8
# Pixels into which the border was mixed when the picture was warped and compressed.
NO_DATA_RIM = 3


def no_data_mask(image: np.ndarray) -> np.ndarray:
    """The black corners of an image (h, w, 3) uint8, (h, w) bool: flat black that hangs together with a corner of the picture.

    What is dark elsewhere at the border, or upright at its foot as a gateway is, is part of what the picture shows. A
    picture that is black as a whole has no corners.
    """
    import cv2

    red, green, blue = np.moveaxis(image, 2, 0)
    black = (np.maximum(np.maximum(red, green), blue) <= BLACK).astype(np.uint8)
    if black.all():
        return np.zeros(black.shape, bool)
    # a compressed edge is no straight line: single pixels do not tie a corner to a window
    solid = cv2.morphologyEx(black, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8), borderType=cv2.BORDER_REPLICATE)
    _, parts, stats, _ = cv2.connectedComponentsWithStats(solid, connectivity=4)
    corners = {int(part) for part in parts[[0, 0, -1, -1], [0, -1, 0, -1]]} - {0}
    kept = [
        part
        for part in corners
        if stats[part, cv2.CC_STAT_AREA] >= LEAST * black.size
        and not _is_gateway(stats[part], black.shape[0])
        and _is_warped(image, (parts == part).astype(np.uint8))
    ]
    found = np.isin(parts, kept).astype(np.uint8)
    return cv2.dilate(found, np.ones((2 * NO_DATA_RIM + 1, 2 * NO_DATA_RIM + 1), np.uint8)).astype(bool)


def _is_gateway(stats: np.ndarray, height: int) -> bool:
    _, top, wide, high, area = stats.tolist()
    return 0 < top == height - high and high > wide and area >= MOST_FILLED * wide * high


def _is_warped(image: np.ndarray, part: np.ndarray) -> bool:
    """Whether a part (h, w) uint8 has few straight sides, as what lies beside a warped rectangle has, or one colour, as no deep
    shadow has."""
    import cv2

    contours, _ = cv2.findContours(part, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    sides = [cv2.approxPolyDP(contour, STRAIGHT * max(part.shape), closed=True) for contour in contours]
    drawn = cv2.fillPoly(np.zeros_like(part), sides, 1)
    if sum(map(len, sides)) <= MOST_SIDES and (drawn & part).sum() >= ALIKE * (drawn | part).sum():
        return True
    inner = cv2.erode(part, np.ones((4 * NO_DATA_RIM + 1, 4 * NO_DATA_RIM + 1), np.uint8), borderValue=1).astype(bool)
    values = image[inner].max(axis=1).astype(np.int64)
    return values.size > 0 and bool((np.abs(values - np.median(values)) <= NOISE).mean() >= FLAT)
