"""What facades have in common, used on a parse: windows are rectangles, and those of a floor or a column share lines.

Each window's box is moved, edge by edge, to where the confidence inside is highest; the boxes of one floor (or column)
then take the line that is best for all of them together, unless a box's own pixels speak against it. Balconies, doors
and shops are left as they are: made rectangular in the same way, they lost.
"""

from __future__ import annotations

import numpy as np

from facade_core.core.labels import CLASSES, FacadeClass
from facade_core.parsing.elements import elements

# An edge is moved by at most this share of the box's side, and at least by a few pixels.
_REACH, _LEAST_REACH = 0.3, 3
# A box takes the common line if that loses less than this, in nats per pixel of the edge.
_TOLERANCE = 0.6
# Boxes are of one floor (column) where they share this much of their heights (widths).
_SHARED = 0.6
# A box is drawn where this share of it was window already.
_FILLED = 0.85
# The same share for the emptiest row and column inside: two windows that touch are not one.
_FILLED_LINE = 0.7
_FLOOR = 1e-3


def window_boxes(confidence: np.ndarray) -> np.ndarray:
    """The windows that a confidence map (H, W, 7) float32 shows, made regular: (n, 4) x0, y0, x1, y1 in pixels, half-open."""
    found = [
        (e.x0, e.y0, e.x1, e.y1)
        for e in elements(confidence.argmax(2).astype(np.uint8))
        if e.label == CLASSES[FacadeClass.WINDOW]
    ]
    if not found:
        return np.zeros((0, 4), np.intp)
    score = np.log(np.maximum(confidence, _FLOOR))
    gain = score[..., FacadeClass.WINDOW] - np.delete(score, FacadeClass.WINDOW, axis=2).max(2)
    return _fit(np.array(found, np.intp), gain)


def draw_windows(labels: np.ndarray, confidence: np.ndarray, boxes: np.ndarray) -> None:
    """Draw windows (n, 4) that are mostly window already into labels (H, W) uint8, and give what was window near them but
    outside to the next best class, in place; confidence (H, W, 7), of which labels has the strongest, goes along.

    Where the label changes, the new class and the one that was strongest exchange their confidence.
    """
    kept, near = np.zeros(labels.shape, bool), np.zeros(labels.shape, bool)
    for x0, y0, x1, y1 in boxes.tolist():
        if _is_filled(labels[y0:y1, x0:x1] == FacadeClass.WINDOW):
            kept[y0:y1, x0:x1] = True
            high, wide = (y1 - y0) // 3 + _LEAST_REACH, (x1 - x0) // 3 + _LEAST_REACH
            near[max(0, y0 - high) : y1 + high, max(0, x0 - wide) : x1 + wide] = True
    changed = np.nonzero(np.where(labels == FacadeClass.WINDOW, near & ~kept, kept))
    rows, before = confidence[changed], labels[changed].astype(np.intp)
    others = rows.copy()
    others[:, FacadeClass.WINDOW] = -1
    after = np.where(before == FacadeClass.WINDOW, others.argmax(1), FacadeClass.WINDOW)
    at = np.arange(len(rows))
    rows[at, before], rows[at, after] = rows[at, after], rows[at, before]
    # of classes that are alike the first is told, as everywhere
    confidence[changed], labels[changed] = rows, rows.argmax(1)


def _fit(boxes: np.ndarray, gain: np.ndarray) -> np.ndarray:
    """Boxes (n, 4) as x0, y0, x1, y1 moved to the gain they enclose, floor by floor, then column by column."""
    for _ in range(2):
        boxes = _align(boxes, gain)
        boxes = _align(boxes[:, [1, 0, 3, 2]], gain.T)[:, [1, 0, 3, 2]]
    return boxes


def _align(boxes: np.ndarray, gain: np.ndarray) -> np.ndarray:
    """Move the upper and lower edges; boxes whose heights overlap most are one floor."""
    moved = boxes.copy()
    for group in _group_intervals(boxes[:, 1], boxes[:, 3]):
        for edge in (1, 3):
            curves = [_edge_curve(boxes[index], edge, gain) for index in group]
            common = _common(curves)
            for index, curve in zip(group, curves, strict=True):
                own = max(curve, key=lambda at: (curve[at], -abs(at - boxes[index, edge])))
                loss = curve[own] - curve.get(common, -np.inf)
                width = boxes[index, 2] - boxes[index, 0]
                moved[index, edge] = common if loss <= _TOLERANCE * width else own
    return moved


def _group_intervals(low: np.ndarray, high: np.ndarray) -> list[list[int]]:
    """Indices of intervals that share most of their length with the first of their group, from the top down."""
    groups: list[list[int]] = []
    for index in np.argsort(low + high, kind="stable"):
        for group in groups:
            first = group[0]
            shared = min(high[index], high[first]) - max(low[index], low[first])
            longest = max(high[index] - low[index], high[first] - low[first])
            if shared >= _SHARED * longest:
                group.append(int(index))
                break
        else:
            groups.append([int(index)])
    return groups


def _edge_curve(box: np.ndarray, edge: int, gain: np.ndarray) -> dict[int, float]:
    """Gain inside the box for each place its upper (1) or lower (3) edge may be moved to."""
    x0, y0, x1, y1 = box
    middle = (y0 + y1) // 2
    reach = max(_LEAST_REACH, int(_REACH * (y1 - y0)))
    at = int(box[edge])
    if edge == 1:
        places = np.arange(max(0, at - reach), min(at + reach, middle) + 1)
        rows = gain[places[0] : middle + 1, x0:x1].sum(1)
        values = rows[::-1].cumsum()[::-1][: len(places)]
    else:
        places = np.arange(max(at - reach, middle + 1), min(len(gain), at + reach) + 1)
        values = gain[middle : places[-1], x0:x1].sum(1).cumsum()[places[0] - middle - 1 :]
    return dict(zip(places.tolist(), values.tolist(), strict=True))


def _common(curves: list[dict[int, float]]) -> int:
    """The place of the highest sum over the curves; beyond its reach a curve counts as at its lowest."""
    lowest = [min(curve.values()) for curve in curves]
    places = sorted(set().union(*curves))
    sums = [sum(curve.get(at, low) for curve, low in zip(curves, lowest, strict=True)) for at in places]
    return places[int(np.argmax(sums))]


def _is_filled(inside: np.ndarray) -> bool:
    """Whether a box is well filled as a whole and in each row and column but those near its edges; an empty one is not."""
    if not inside.size:
        return False
    lines = [inside.mean(axis) for axis in (0, 1)]
    inner = [line[len(line) // 8 : len(line) - len(line) // 8] for line in lines]
    return bool(inside.mean() >= _FILLED and min(line.min() for line in inner) >= _FILLED_LINE)
