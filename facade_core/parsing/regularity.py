"""Regularity of parsed facades: windows are rectangles, and those of a floor or a column share lines.

Each edge of a window's box moves to the place of highest confidence inside. The boxes of one floor (or column) then
take the line that is best for all of them, unless a box's own pixels contradict it. Balconies, doors and shops stay as
they are: the same procedure made them worse.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, Int64Array, UInt8Array
from facade_core.core.labels import CLASSES, FacadeClass
from facade_core.parsing.elements import elements

# An edge moves by at most this share of the box's side,
_MAX_EDGE_MOVE = 0.3
# and by at least this many pixels if necessary.
_MIN_EDGE_MOVE = 3
# A box takes the common line if that loses less than this, in nats per pixel of the edge.
_MAX_LINE_LOSS = 0.6
# Boxes are of one floor (column) if they share this much of their heights (widths).
_MIN_SHARED_EXTENT = 0.6
# A box is drawn if this share of it already was window,
_MIN_FILLED_SHARE = 0.85
# and this share of its emptiest inner row and column: two windows that touch are not one.
_MIN_FILLED_LINE = 0.7
# Confidences are cut here before their logarithm.
_MIN_CONFIDENCE = 1e-3


def extract_regular_window_boxes(confidence: Float32Array) -> Int64Array:
    """Extract regular windows from a confidence map (H, W, 7) float32.

    Returns
    -------
    (n, 4) x0, y0, x1, y1 in pixels, half-open.
    """
    boxes = [
        (e.x0, e.y0, e.x1, e.y1)
        for e in elements(confidence.argmax(2).astype(np.uint8))
        if e.label == CLASSES[FacadeClass.WINDOW]
    ]
    if not boxes:
        return np.zeros((0, 4), np.intp)
    score = np.log(np.maximum(confidence, _MIN_CONFIDENCE))
    gain = score[..., FacadeClass.WINDOW] - np.delete(score, FacadeClass.WINDOW, axis=2).max(2)
    return _fit_boxes(np.array(boxes, np.intp), gain)


def draw_windows_into_labels(labels: UInt8Array, confidence: Float32Array, boxes: Int64Array) -> None:
    """Draw window boxes into labels and confidence, in place.

    Only boxes that are mostly window already are drawn. Window pixels near them, but outside, get the next best class.
    Where the label changes, the new class and the strongest one exchange their confidence.

    Parameters
    ----------
    labels : (H, W) uint8 strongest class; changed in place.
    confidence : (H, W, 7); changed in place.
    boxes : (n, 4) x0, y0, x1, y1.
    """
    is_window, is_near = np.zeros(labels.shape, bool), np.zeros(labels.shape, bool)
    for x0, y0, x1, y1 in boxes.tolist():
        if _is_filled(labels[y0:y1, x0:x1] == FacadeClass.WINDOW):
            is_window[y0:y1, x0:x1] = True
            margin_y, margin_x = (y1 - y0) // 3 + _MIN_EDGE_MOVE, (x1 - x0) // 3 + _MIN_EDGE_MOVE
            is_near[max(0, y0 - margin_y) : y1 + margin_y, max(0, x0 - margin_x) : x1 + margin_x] = True
    changed = np.nonzero(np.where(labels == FacadeClass.WINDOW, is_near & ~is_window, is_window))
    rows, before = confidence[changed], labels[changed].astype(np.intp)
    others = rows.copy()
    others[:, FacadeClass.WINDOW] = -1
    after = np.where(before == FacadeClass.WINDOW, others.argmax(1), FacadeClass.WINDOW)
    index = np.arange(len(rows))
    rows[index, before], rows[index, after] = rows[index, after], rows[index, before]
    # the first of equal classes wins, as everywhere
    confidence[changed], labels[changed] = rows, rows.argmax(1)


def _fit_boxes(boxes: Int64Array, gain: Float32Array) -> Int64Array:
    """Boxes (n, 4) moved to the gain they enclose, floor by floor, then column by column."""
    for _ in range(2):
        boxes = _align(boxes, gain)
        boxes = _align(boxes[:, [1, 0, 3, 2]], gain.T)[:, [1, 0, 3, 2]]
    return boxes


def _align(boxes: Int64Array, gain: Float32Array) -> Int64Array:
    """Boxes with upper and lower edges moved; boxes whose heights overlap most form one floor."""
    moved = boxes.copy()
    for group in _group_intervals(boxes[:, 1], boxes[:, 3]):
        for edge in (1, 3):
            curves = [_edge_curve(boxes[index], edge, gain) for index in group]
            common = _common_place(curves)
            for index, (first, gains) in zip(group, curves, strict=True):
                highest = first + np.flatnonzero(gains == gains.max())
                own_place = highest[np.argmin(np.abs(highest - boxes[index, edge]))]
                loss = gains.max() - gains[common - first] if first <= common < first + len(gains) else np.inf
                width = boxes[index, 2] - boxes[index, 0]
                moved[index, edge] = common if loss <= _MAX_LINE_LOSS * width else own_place
    return moved


def _group_intervals(low: Int64Array, high: Int64Array) -> list[list[int]]:
    """Return the indices of intervals that share most of their length with the first of their group, from the top down."""
    groups: list[list[int]] = []
    for index in np.argsort(low + high, kind="stable"):
        for group in groups:
            first = group[0]
            shared = min(high[index], high[first]) - max(low[index], low[first])
            longest = max(high[index] - low[index], high[first] - low[first])
            if shared >= _MIN_SHARED_EXTENT * longest:
                group.append(int(index))
                break
        else:
            groups.append([int(index)])
    return groups


class _EdgeCurve(NamedTuple):
    """Gain inside a box for each place of an edge, from the first on."""

    first: int
    gains: Float64Array


def _edge_curve(box: Int64Array, edge: int, gain: Float32Array) -> _EdgeCurve:
    """Gain inside the box for each place of its upper (1) or lower (3) edge."""
    x0, y0, x1, y1 = box
    middle = (y0 + y1) // 2
    reach = max(_MIN_EDGE_MOVE, int(_MAX_EDGE_MOVE * (y1 - y0)))
    position = int(box[edge])
    if edge == 1:
        places = np.arange(max(0, position - reach), min(position + reach, middle) + 1)
        rows = gain[places[0] : middle + 1, x0:x1].sum(1)
        values = rows[::-1].cumsum()[::-1][: len(places)]
    else:
        places = np.arange(max(position - reach, middle + 1), min(len(gain), position + reach) + 1)
        values = gain[middle : places[-1], x0:x1].sum(1).cumsum()[places[0] - middle - 1 :]
    return _EdgeCurve(int(places[0]), values.astype(np.float64))


def _common_place(curves: list[_EdgeCurve]) -> int:
    """Place of the highest sum over the curves; beyond its reach a curve counts as its lowest value."""
    start = min(first for first, _ in curves)
    sums = np.zeros(max(first + len(gains) for first, gains in curves) - start)
    for first, gains in curves:
        own = np.full(len(sums), gains.min())
        own[first - start : first - start + len(gains)] = gains
        sums += own
    return start + int(np.argmax(sums))


def _is_filled(inside: BoolArray) -> bool:
    """Return True if a box is well filled as a whole and in each inner row and column."""
    if not inside.size:
        return False
    lines = [inside.mean(axis) for axis in (0, 1)]
    inner = [line[len(line) // 8 : len(line) - len(line) // 8] for line in lines]
    return bool(inside.mean() >= _MIN_FILLED_SHARE and min(line.min() for line in inner) >= _MIN_FILLED_LINE)
