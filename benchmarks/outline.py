"""Where a parser sees the facade end: sky, street and neighbours, and the box that a picture is cut to."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from facade_core.core.labels import UNKNOWN
from facade_core.imagery.rectify.crop import find_facade_box
from training.datasets.facades import LabelledFacade

# A side of a box is right within this share of the picture's height or width.
_NEAR = 0.03
_CELLS = 80

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


def best_box(outside: np.ndarray) -> tuple[int, int, int, int]:
    """The box (x0, y0, x1, y1) with the most pixels inside over those outside (H, W) bool, by trying all whose corners lie on a
    grid of so many cells a side: plain, and apart from what is measured."""
    height, width = outside.shape
    value = np.zeros((height + 1, width + 1))
    value[1:, 1:] = np.where(outside, -1, 1).cumsum(0).cumsum(1)
    ys, xs = (np.unique(np.linspace(0, side, _CELLS + 1).round().astype(int)) for side in (height, width))
    sums = value[np.ix_(ys, xs)]
    best, found = -np.inf, (0, 0, width, height)
    for top, bottom in itertools.combinations(range(len(ys)), 2):
        rows = sums[bottom] - sums[top]
        gain = rows[None, :] - rows[:, None]
        left, right = divmod(int(gain.argmax()), len(xs))
        if gain[left, right] > best:
            best, found = gain[left, right], (int(xs[left]), int(ys[top]), int(xs[right]), int(ys[bottom]))
    return found


def measure_boxes(facades: Iterable[LabelledFacade], outside: Outside) -> dict[str, Any]:
    """Of rectified pictures cut to the facade: how many of their sides lie within 3 % of the true box's, and how many do of
    the picture as it is; the mean share of the facade that is cut off, and of what is outside, before
    and after."""
    sides = np.zeros(2, np.int64)
    lost, before, after = [], [], []
    for facade in facades:
        truth, nothing = facade.outside == 1, np.zeros(facade.outside.shape, bool)
        height, width = truth.shape
        right = np.array(best_box(truth))
        x0, y0, x1, y1 = box = find_facade_box(outside(facade.image), nothing) or (0, 0, width, height)
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
