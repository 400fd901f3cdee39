"""Trees before a rectified facade that the parser takes for wall."""

from __future__ import annotations

import cv2
import numpy as np

from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.core.resizing import resize_with_labels

# Longest side in pixels at which leaves are looked for.
_SIDE_PX = 320
# Colour of leaves in CIELAB: greener than grey and than the wall's median, yellower than grey, and darker than a lit wall.
MAX_LEAF_RED = -2.0
MIN_LEAF_YELLOW = 2.0
MIN_GREENER = 4.0
MAX_LEAF_LIGHTNESS = 70.0
# Least deviation of lightness within 7 x 7 pixels; green walls and blinds are more even.
MIN_LEAF_DEVIATION = 3.0
# Share of the picture from which connected leaves are a tree; plants on balconies are smaller.
MIN_TREE_SHARE = 0.01
# Largest width of a tree over its height; green plinths and the signs of shops are wider.
MAX_TREE_ASPECT = 3.0
# Largest share of a tree's pixels in windows, and of its bounding box that it fills: green shutters exceed one of them.
MAX_WINDOW_SHARE = 0.7
MAX_FILLED_SHARE = 0.85
# Trees begin below this share of the height; plants on a roof terrace are above.
FIRST_TREE_ROW_SHARE = 1 / 3


def measure_tree_share(image: UInt8Array, labels: UInt8Array, hidden: BoolArray) -> float:
    """Measure the share of a facade that trees cover which are not hidden.

    Parameters
    ----------
    image : (h, w, 3) uint8, rectified.
    labels : (h, w) uint8 class ids.
    hidden : (h, w) bool, pixels that do not show the facade.
    """
    factor = min(1.0, _SIDE_PX / max(labels.shape))
    height, width = (max(8, round(side * factor)) for side in labels.shape)
    small, classes = resize_with_labels(image, labels, (height, width))
    seen = cv2.resize(hidden.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST) == 0
    lab = cv2.cvtColor(small.astype(np.float32) / 255, cv2.COLOR_RGB2LAB)
    wall = lab[(classes == FacadeClass.WALL) & seen]
    if not len(wall):
        return 0.0
    lightness, red, yellow = np.moveaxis(lab, 2, 0)
    deviation = cv2.blur(lightness**2, (7, 7)) - cv2.blur(lightness, (7, 7)) ** 2
    leaves = (red < min(MAX_LEAF_RED, float(np.median(wall[:, 1])) - MIN_GREENER)) & (yellow > MIN_LEAF_YELLOW)
    leaves &= (lightness < MAX_LEAF_LIGHTNESS) & (deviation > MIN_LEAF_DEVIATION**2)
    crowns = cv2.morphologyEx(leaves.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    crowns = cv2.morphologyEx(crowns, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    crowns[: round(FIRST_TREE_ROW_SHARE * height)] = 0
    count, parts, stats, _ = cv2.connectedComponentsWithStats(crowns)
    windows = np.bincount(parts.ravel(), (classes == FacadeClass.WINDOW).ravel(), minlength=count)
    trees = []
    for part in range(1, count):
        wide, high, area = (
            stats[part, cv2.CC_STAT_WIDTH],
            stats[part, cv2.CC_STAT_HEIGHT],
            stats[part, cv2.CC_STAT_AREA],
        )
        is_shutter = windows[part] > MAX_WINDOW_SHARE * area or area > MAX_FILLED_SHARE * wide * high
        if area >= MIN_TREE_SHARE * crowns.size and wide <= MAX_TREE_ASPECT * high and not is_shutter:
            trees.append(part)
    return float((np.isin(parts, trees) & seen).mean())
