"""Sky above the eaves of a rectified facade that the parser takes for wall."""

from __future__ import annotations

import cv2
import numpy as np

from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.core.resizing import resize_image
from facade_core.parsing.floor_structure import find_floors_and_bays

# Longest side in pixels at which sky is looked for.
_SIDE_PX = 320
# Least lightness of the sky by day and its largest yellow share, in CIELAB.
MIN_SKY_LIGHTNESS = 60.0
MAX_SKY_YELLOW = 6.0
# Difference in CIELAB from the wall below; a difference to darker does not count.
MIN_SKY_DIFFERENCE = 16.0
# Largest deviation of lightness within 5 x 5 pixels: a wall has joints, ledges and windows.
MAX_SKY_DEVIATION = 2.5
# Share of a row that shows the sky from which the row is not of the facade.
MIN_SKY_ROW_SHARE = 0.05


def count_sky_rows(image: UInt8Array, labels: UInt8Array) -> int:
    """Count the rows at the top of a facade that show sky beside gables, dormers or lettering.

    Sky is bright, even, connected with the upper border, and differs in colour from the wall. Sky between the windows of the
    highest floor shows that they are dormers: the floor is counted too. Sky that reaches farther down is beside the house, or
    a bright wall.

    Parameters
    ----------
    image : (h, w, 3) uint8, rectified.
    labels : (h, w) uint8 class ids, without sky.
    """
    found = find_floors_and_bays(labels)
    if found is None:
        return 0
    rows = np.flatnonzero(find_even_sky(image, labels).mean(axis=1) >= MIN_SKY_ROW_SHARE)
    last = int(rows[-1]) + 1 if len(rows) else 0
    top, bottom = found.floors[0]
    if len(found.floors) > 1 and (top + bottom) / 2 <= last <= found.floor_cuts[1]:
        return found.floor_cuts[1]
    return min(last, top)


def find_even_sky(image: UInt8Array, labels: UInt8Array) -> BoolArray:
    """Find the bright and even pixels (h, w) that are connected with the upper border and differ from the wall."""
    factor = min(1.0, _SIDE_PX / max(labels.shape))
    size = max(8, round(labels.shape[0] * factor)), max(8, round(labels.shape[1] * factor))
    lab = cv2.cvtColor(resize_image(image, size).astype(np.float32) / 255, cv2.COLOR_RGB2LAB)
    classes = cv2.resize(labels, size[::-1], interpolation=cv2.INTER_NEAREST)
    below = lab[size[0] // 3 :][classes[size[0] // 3 :] == FacadeClass.WALL]
    if not len(below):
        return np.zeros(labels.shape, bool)
    difference = lab - np.median(below, axis=0)
    difference[..., 0] = np.maximum(difference[..., 0], 0)
    lightness = lab[..., 0]
    deviation = cv2.blur(lightness**2, (5, 5)) - cv2.blur(lightness, (5, 5)) ** 2
    sky = (lightness >= MIN_SKY_LIGHTNESS) & (lab[..., 2] <= MAX_SKY_YELLOW)
    sky &= (np.linalg.norm(difference, axis=2) >= MIN_SKY_DIFFERENCE) & (deviation <= MAX_SKY_DEVIATION**2)
    parts = cv2.connectedComponents(sky.astype(np.uint8), connectivity=4)[1]
    connected = np.isin(parts, np.unique(parts[0][sky[0]])) & sky
    return cv2.resize(connected.astype(np.uint8), labels.shape[::-1], interpolation=cv2.INTER_NEAREST) > 0
