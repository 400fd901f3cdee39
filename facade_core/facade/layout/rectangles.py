"""Pairwise relations of element rectangles: overlap, IoU and exclusion; compiled."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, Int64Array, IntArray, NumericArray
from facade_core.core.labels import ELEMENT_CLASSES
from facade_core.core.numba_cache import njit

WINDOW, BALCONY, DOOR, SHOP = range(len(ELEMENT_CLASSES))
# Smallest IoU of duplicate guesses of one label.
_MIN_DUPLICATE_IOU = 0.75


@njit(cache=True)
def _box_iou(p: Float64Array, q: Float64Array) -> float:
    w = min(p[2], q[2]) - max(p[0], q[0])
    h = min(p[3], q[3]) - max(p[1], q[1])
    if w <= 0 or h <= 0:
        return 0.0
    iou: float = w * h / ((p[2] - p[0]) * (p[3] - p[1]) + (q[2] - q[0]) * (q[3] - q[1]) - w * h)
    return iou


@njit(cache=True)
def pairwise_iou(a: Float64Array, b: Float64Array) -> Float64Array:
    """Return the (N, M) intersection over union of (N, 4) and (M, 4) rectangles."""
    out = np.empty((len(a), len(b)))
    for i in range(len(a)):
        for j in range(len(b)):
            out[i, j] = _box_iou(a[i], b[j])
    return out


@njit(cache=True)
def overlap_mask(a: Float64Array, b: Float64Array) -> BoolArray:
    """Return, (N, M) bool, whether open rectangles (N, 4) and (M, 4) share area."""
    out = np.empty((len(a), len(b)), np.bool_)
    for i in range(len(a)):
        for j in range(len(b)):
            p, q = a[i], b[j]
            out[i, j] = min(p[2], q[2]) > max(p[0], q[0]) and min(p[3], q[3]) > max(p[1], q[1])
    return out


@njit(cache=True)
def best_iou_by_variant(kept: Float64Array, raw: Float64Array, variant: Int64Array, variants: int) -> Float32Array:
    """Return the largest IoU of each kept guess with a guess of each variant of the same label.

    Parameters
    ----------
    kept : (K, 5) label and corners.
    raw : (N, 5) label and corners of all guesses.
    variant : (N,) variant of each row of `raw`.
    variants : number of variants.

    Returns
    -------
    (K, variants) float32.
    """
    out = np.zeros((len(kept), variants), np.float32)
    for i in range(len(kept)):
        for j in range(len(raw)):
            if kept[i, 0] == raw[j, 0]:
                out[i, variant[j]] = max(out[i, variant[j]], _box_iou(kept[i, 1:], raw[j, 1:]))
    return out


@njit(cache=True)
def select_distinct_rectangles(box: Float64Array) -> Int64Array:
    """Return indices of rectangles (N, 4) of which none nearly equals an earlier one."""
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


def labels_may_overlap(a: NumericArray, b: IntArray) -> BoolArray:
    """Return, (N, M) bool, whether elements of two labels may overlap: a balcony and its window only.

    Parameters
    ----------
    a, b : (N,) and (M,) index into ELEMENT_CLASSES.
    """
    are_allowed: BoolArray = ((a[:, None] == WINDOW) & (b == BALCONY)) | ((a[:, None] == BALCONY) & (b == WINDOW))
    return are_allowed
