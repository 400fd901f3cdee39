"""Corners without data that the warp of a rectified picture leaves: black, or filled with one colour."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from facade_core.core.arrays import BoolArray, Int32Array, IntArray, UInt8Array

# Largest value of the border that a warp leaves, also with JPEG ringing; facades are rarely so black.
BLACK_LEVEL = 14
# Pixels from a corner to the patch by which it has a fill, and the patch's side: a thin frame may hide the corner itself.
CORNER_INSET_PX = 8
CORNER_PATCH_PX = 5
# A fill of another colour is darker than an overexposed sky, covers at most this share of the picture,
MAX_FILL_LEVEL = 250
MAX_FILL_SHARE = 0.5
# and is exactly one colour in this share of its inner pixels, which no sky and no wall of a photo is. A wall of a drawing may
# be, but encloses windows, of at least MIN_CORNER_SHARE each; a fill encloses fewer than this many.
MIN_EXACT_SHARE = 0.95
MIN_WINDOWS = 3
# Smallest share of the picture of such a corner; smaller ones are shadows or frames.
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
# Pixels into which warp and compression mixed the border; they exceed FLAT_NOISE farther from a fill that is not black.
NO_DATA_RIM = 3
FILL_RIM = 12


def no_data_mask(image: UInt8Array) -> BoolArray:
    """Mask the corners of an image without data: flat black or one colour, connected to a corner of the picture.

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
    found = _dilate(_corner_parts(black, (0,), lambda part: _is_warped(image, part)), NO_DATA_RIM)
    for colour in _corner_fills(image):
        fill = np.asarray(cv2.inRange(image, colour - FLAT_NOISE, colour + FLAT_NOISE), np.uint8) // 255
        if fill.mean() <= MAX_FILL_SHARE:
            rim = NO_DATA_RIM if colour.max() <= BLACK_LEVEL else FILL_RIM
            parts = _corner_parts(fill, (0, CORNER_INSET_PX), lambda part: _is_fill(image, part))
            found |= _dilate(parts, rim)
    return found


def _corner_fills(image: UInt8Array) -> IntArray:
    """Return the colours (n, 3) of even patches near the corners of an image, but overexposed ones."""
    far = CORNER_INSET_PX + CORNER_PATCH_PX
    if min(image.shape[:2]) < far:
        return np.zeros((0, 3), np.int64)
    spans = slice(CORNER_INSET_PX, far), slice(-far, -CORNER_INSET_PX)
    patches = [image[rows, columns].reshape(-1, 3) for rows in spans for columns in spans]
    fills = [patch[0] for patch in patches if (patch == patch[0]).all() and patch[0].max() < MAX_FILL_LEVEL]
    return np.unique(np.array(fills, np.int64).reshape(-1, 3), axis=0)


def _dilate(mask: UInt8Array, radius: int) -> BoolArray:
    import cv2

    return cv2.dilate(mask, np.ones((2 * radius + 1, 2 * radius + 1), np.uint8)).astype(bool)


def _corner_pixels(insets: Sequence[int]) -> tuple[list[int], list[int]]:
    """Return rows and columns of the corners of a picture, at each inset from its sides."""
    corners = [(row, column) for near in insets for row in (near, ~near) for column in (near, ~near)]
    return [row for row, _ in corners], [column for _, column in corners]


def _corner_parts(mask: UInt8Array, insets: Sequence[int], is_no_data: Callable[[UInt8Array], bool]) -> UInt8Array:
    """Return the accepted parts of a mask (h, w) that contain a corner of the picture, (h, w) uint8."""
    import cv2

    # opening: single pixels of a compressed edge must not connect a corner to a window
    solid = cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8), borderType=cv2.BORDER_REPLICATE)
    _, parts, stats, _ = cv2.connectedComponentsWithStats(solid, connectivity=4)
    border = np.concatenate([parts[[0, -1]].ravel(), parts[:, [0, -1]].ravel()])
    corners = {int(part) for part in parts[_corner_pixels(insets)] if part and part in border}
    accepted = [
        part
        for part in corners
        if stats[part, cv2.CC_STAT_AREA] >= MIN_CORNER_SHARE * mask.size
        and not _is_gateway(stats[part], mask.shape[0])
        and is_no_data((parts == part).astype(np.uint8))
    ]
    return np.isin(parts, accepted).astype(np.uint8)


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
    values = image[_erode_rim(part)].max(axis=1).astype(np.int64)
    return values.size > 0 and bool((np.abs(values - np.median(values)) <= FLAT_NOISE).mean() >= MIN_FLAT_SHARE)


def _is_fill(image: UInt8Array, part: UInt8Array) -> bool:
    """Return True if the inner pixels of a part (h, w) uint8 have exactly one colour, and it does not enclose windows."""
    import cv2

    values = image[_erode_rim(part)]
    if len(values) == 0 or (values == np.median(values, axis=0)).all(axis=1).mean() < MIN_EXACT_SHARE:
        return False
    contours, parents = cv2.findContours(part, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    enclosed = [contour for contour, (*_, parent) in zip(contours, parents[0], strict=True) if parent >= 0]
    return sum(cv2.contourArea(contour) >= MIN_CORNER_SHARE * part.size for contour in enclosed) < MIN_WINDOWS


def _erode_rim(part: UInt8Array) -> BoolArray:
    """Return a part (h, w) without the rim into which compression mixed its surroundings."""
    import cv2

    return cv2.erode(part, np.ones((4 * NO_DATA_RIM + 1, 4 * NO_DATA_RIM + 1), np.uint8), borderValue=1).astype(bool)
