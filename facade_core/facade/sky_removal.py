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
# Blue from which a clear sky counts that is darker, in CIELAB.
MAX_CLEAR_SKY_YELLOW = -14.0
# Difference in CIELAB from the wall below; a difference to darker does not count.
MIN_SKY_DIFFERENCE = 16.0
# Largest deviation of lightness within 5 x 5 pixels: a wall has joints, ledges and windows.
MAX_SKY_DEVIATION = 2.5
# Share of the rows that a border without data has at the top at most, and rows below it that are not even.
MAX_BORDER_SHARE = 0.02
BORDER_RIM_PX = 4
# Share of a row that shows the sky from which the row is not of the facade.
MIN_SKY_ROW_SHARE = 0.02
# The same from which floors beside the sky are cut off with it: a slit between two houses is narrower.
MIN_BESIDE_SHARE = 0.05
# Floors beside which sky is cut off with it: these remain, and they reach no farther down than this share of the height.
MIN_REMAINING_FLOORS = 2
MAX_CUT_SHARE = 0.4


def count_sky_rows(image: UInt8Array, labels: UInt8Array, hidden: BoolArray, outside: BoolArray) -> int:
    """Count the rows at the top of a facade that show sky beside gables, dormers, towers or lettering.

    Sky is bright or blue, even, connected with the upper border, and differs in colour from the wall, or the parser finds it.
    Sky between the windows of the highest floors shows that these are dormers or of a narrower tower: they are counted too.
    Sky that reaches farther down is beside the house, or a bright wall.

    Parameters
    ----------
    image : (h, w, 3) uint8, rectified.
    labels : (h, w) uint8 class ids, without sky.
    hidden : (h, w) bool, pixels that do not show the facade, such as a border without data.
    outside : (h, w) bool, of these sky, street or neighbours by the parser.
    """
    found = find_floors_and_bays(labels)
    if found is None:
        return 0
    share = find_even_sky(image, labels, hidden, outside).mean(axis=1)
    last, last_wide = (
        int(np.flatnonzero(np.append(True, share >= least))[-1]) for least in (MIN_SKY_ROW_SHARE, MIN_BESIDE_SHARE)
    )
    beside = sum((top + bottom) / 2 <= last_wide for top, bottom in found.floors)
    if beside == 0 or len(found.floors) - beside < MIN_REMAINING_FLOORS or last > MAX_CUT_SHARE * len(labels):
        return min(last, found.floors[0][0])
    return max(found.floor_cuts[beside], min(last, found.floors[beside][0]))


def find_even_sky(image: UInt8Array, labels: UInt8Array, hidden: BoolArray, outside: BoolArray) -> BoolArray:
    """Find the pixels (h, w) of sky that are connected with the upper border; parameters as in `count_sky_rows`."""
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
    sky = (lightness >= MIN_SKY_LIGHTNESS) & (lab[..., 2] <= MAX_SKY_YELLOW) | (lab[..., 2] <= MAX_CLEAR_SKY_YELLOW)
    sky &= (np.linalg.norm(difference, axis=2) >= MIN_SKY_DIFFERENCE) & (deviation <= MAX_SKY_DEVIATION**2)
    unseen, beyond = (
        cv2.resize(mask.astype(np.uint8), size[::-1], interpolation=cv2.INTER_NEAREST) > 0 for mask in (hidden, outside)
    )
    sky = sky & ~unseen | beyond
    border = np.logical_and.accumulate(unseen[: max(2, round(MAX_BORDER_SHARE * size[0]))], axis=0).sum(axis=0)
    joined = sky | (np.arange(size[0])[:, None] < np.where(border > 0, border + BORDER_RIM_PX, 0))
    parts = cv2.connectedComponents(joined.astype(np.uint8), connectivity=4)[1]
    connected = np.isin(parts, np.unique(parts[0][joined[0]])) & sky
    return cv2.resize(connected.astype(np.uint8), labels.shape[::-1], interpolation=cv2.INTER_NEAREST) > 0
