"""The outline of a thing of which a detector gave the box."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

# x0, y0, x1, y1 in pixels of the image, half-open.
Box = tuple[int, int, int, int]

# A mask that fills less of its box than this has lost the thing; an ellipse is nearer to it.
_LEAST_FILLED = 0.35


def cut_out(image: np.ndarray, box: Box) -> np.ndarray:
    """The thing in a box of an image (H, W, 3) uint8, as a mask (h, w) bool of the box: GrabCut (Rother et al. 2004), which
    learns the colours of what is not the thing from around the box. Where it loses the thing, an oval stands for it."""
    import cv2

    x0, y0, x1, y1 = box
    across, down = (max(4, (side + 1) // 3) for side in (x1 - x0, y1 - y0))
    left, up = max(0, x0 - across), max(0, y0 - down)
    around = np.ascontiguousarray(image[up : y1 + down, left : x1 + across])
    told = np.full(around.shape[:2], cv2.GC_BGD, np.uint8)
    inside = np.s_[y0 - up : y1 - up, x0 - left : x1 - left]
    told[inside] = cv2.GC_PR_FGD
    height, width = y1 - y0, x1 - x0
    y, x = np.mgrid[0:height, 0:width]
    oval = ((2 * x + 1) / width - 1) ** 4 + ((2 * y + 1) / height - 1) ** 4
    told[inside][oval < 0.1] = cv2.GC_FGD
    told[inside][oval > 1.5] = cv2.GC_BGD
    cv2.setRNGSeed(0)
    cv2.grabCut(around, told, (0, 0, 0, 0), np.zeros((1, 65)), np.zeros((1, 65)), 3, cv2.GC_INIT_WITH_MASK)
    seen = np.isin(told[inside], (cv2.GC_FGD, cv2.GC_PR_FGD))
    seen = ndimage.binary_fill_holes(ndimage.binary_closing(np.pad(seen, 5), iterations=3))[5:-5, 5:-5]
    return seen if seen.mean() >= _LEAST_FILLED else oval <= 1
