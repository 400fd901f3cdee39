"""Where a parser sees the facade end: sky, street and neighbours, and the box that a picture is cut to."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from catalogs.learning.datasets import LabelledFacade
from facade_core.labels import UNKNOWN
from facade_core.rectify.cut import facade_box

# A side of a box is right within this share of the picture's height or width.
_NEAR = 0.03

Outside = Callable[[np.ndarray], np.ndarray]


def measure_outside(photos: Iterable[LabelledFacade], outside: Outside) -> dict[str, Any]:
    """IoU, precision and recall of the pixels outside facades, over all photos together, where it is known; outside:
    (H, W, 3) uint8 -> (H, W) bool."""
    both = found = true = images = 0
    for photo in photos:
        known = photo.outside != UNKNOWN
        truth, seen = photo.outside[known] == 1, outside(photo.image)[known]
        both, found, true = both + int((truth & seen).sum()), found + int(seen.sum()), true + int(truth.sum())
        images += 1
    return {
        "iou": round(both / max(1, true + found - both), 4),
        "precision": round(both / max(1, found), 4),
        "recall": round(both / max(1, true), 4),
        "images": images,
    }


def measure_boxes(facades: Iterable[LabelledFacade], outside: Outside) -> dict[str, Any]:
    """Of rectified pictures cut to the facade: how many of their sides lie within 3 % of the true box's, and how many do of
    the picture as it is; the mean share of the facade that is cut off, and of what is outside, before
    and after."""
    sides = np.zeros(2, np.int64)
    lost, before, after = [], [], []
    for facade in facades:
        truth, nothing = facade.outside == 1, np.zeros(facade.outside.shape, bool)
        height, width = truth.shape
        right = np.array(facade_box(truth, nothing))
        x0, y0, x1, y1 = box = facade_box(outside(facade.image), nothing)
        size = np.array([width, height, width, height])
        sides += [(abs(np.array(one) - right) <= _NEAR * size).sum() for one in (box, (0, 0, width, height))]
        kept = truth[y0:y1, x0:x1]
        lost.append(1 - (~kept).sum() / max(1, (~truth).sum()))
        before.append(truth.mean())
        after.append(kept.mean())
    return {
        "sides": round(float(sides[0] / max(1, 4 * len(lost))), 4),
        "sides_uncut": round(float(sides[1] / max(1, 4 * len(lost))), 4),
        "facade_lost": round(float(np.mean(lost)), 4),
        "outside_before": round(float(np.mean(before)), 4),
        "outside_after": round(float(np.mean(after)), 4),
        "images": len(lost),
    }
