"""Rectangles of elements against each other, compiled: how much they share and which exclude each other."""

from __future__ import annotations

import numpy as np

from facade_core.core.labels import ELEMENT_CLASSES
from facade_core.core.numba_cache import njit

WINDOW, BALCONY, DOOR, SHOP = range(len(ELEMENT_CLASSES))
# Rectangles of one label that overlap by this share of their union are one guess.
_MIN_DUPLICATE_IOU = 0.75


@njit(cache=True)
def _box_iou(p: np.ndarray, q: np.ndarray) -> float:
    w = min(p[2], q[2]) - max(p[0], q[0])
    h = min(p[3], q[3]) - max(p[1], q[1])
    if w <= 0 or h <= 0:
        return 0.0
    return w * h / ((p[2] - p[0]) * (p[3] - p[1]) + (q[2] - q[0]) * (q[3] - q[1]) - w * h)


@njit(cache=True)
def pairwise_iou(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(N, M) intersection over union of (N, 4) and (M, 4) rectangles."""
    out = np.empty((len(a), len(b)))
    for i in range(len(a)):
        for j in range(len(b)):
            out[i, j] = _box_iou(a[i], b[j])
    return out


@njit(cache=True)
def pairwise_overlap(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(N, M) bool: the open rectangles share area."""
    out = np.empty((len(a), len(b)), np.bool_)
    for i in range(len(a)):
        for j in range(len(b)):
            p, q = a[i], b[j]
            out[i, j] = min(p[2], q[2]) > max(p[0], q[0]) and min(p[3], q[3]) > max(p[1], q[1])
    return out


@njit(cache=True)
def best_iou_by_variant(kept: np.ndarray, raw: np.ndarray, variant: np.ndarray, variants: int) -> np.ndarray:
    """(K, variants) the largest IoU of each row of `kept` with a row of each variant of the same label; rows (N, 5) are label
    and corners, variant (N,) whose guess a row of `raw` is."""
    out = np.zeros((len(kept), variants), np.float32)
    for i in range(len(kept)):
        for j in range(len(raw)):
            if kept[i, 0] == raw[j, 0]:
                out[i, variant[j]] = max(out[i, variant[j]], _box_iou(kept[i, 1:], raw[j, 1:]))
    return out


@njit(cache=True)
def select_representatives(box: np.ndarray) -> np.ndarray:
    """Rectangles, first come first served, none of which is alike to an earlier one."""
    kept = np.empty(len(box), np.int64)
    n = 0
    for i in range(len(box)):
        new = True
        for k in range(n):
            if _box_iou(box[i], box[kept[k]]) >= _MIN_DUPLICATE_IOU:
                new = False
                break
        if new:
            kept[n] = i
            n += 1
    return kept[:n]


def may_overlap(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(N, M) bool for labels: a balcony stands before its window; nothing else shares a place."""
    return ((a[:, None] == WINDOW) & (b == BALCONY)) | ((a[:, None] == BALCONY) & (b == WINDOW))
