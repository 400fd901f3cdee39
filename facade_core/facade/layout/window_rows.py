"""Completion of whole window rows: by the rhythm of the neighbouring row, and where a floor is missing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, Int64Array
from facade_core.core.types import Element
from facade_core.facade.layout.facade_frame import cluster_positions_by_gap
from facade_core.facade.layout.grids import ALIGNMENT_TOLERANCE, box_array
from facade_core.facade.layout.proposals import Proposals
from facade_core.facade.layout.rectangles import BALCONY, WINDOW, overlap_mask
from facade_core.facade.layout.selection import select_proposals

# Smallest IoU of the sides of windows in one column or one row.
_MIN_SIDE_IOU = 0.6
# A row with this share of its neighbour's windows is completed.
_MIN_NEIGHBOUR_SHARE = 0.5
# Smallest gap between windows as a share of their width, where no floor shows two.
_SINGLE_GAP_SHARE = 0.1
# Upper bound of the smallest gap, as a share of the window width.
_MAX_GAP_SHARE = 0.2
# Smallest gap as a share of the smallest observed one.
_OBSERVED_GAP_SHARE = 0.6
# Smallest number of windows of a new row, as a share of the nearest row's.
_MIN_ROW_COVER = 0.5
# Smallest distance of a new row from the nearest row, in pitches.
_MIN_ROW_PITCH = 0.75
# Factor of the threshold for a row between two floors, since no floor is blank.
_INNER_ROW_FACTOR = 0.35
_NO_BOXES = np.zeros((0, 4))


class RowLimits(NamedTuple):
    """Limits of a row of windows.

    Attributes
    ----------
    min_gap : smallest distance between windows of a row.
    threshold : least mean probability of a row above all others.
    ground_threshold : the same below all others.
    """

    min_gap: float
    threshold: float
    ground_threshold: float


def find_missing_windows(
    proposals: Proposals,
    selected: Int64Array,
    probability: Float64Array,
    observed: Sequence[Element],
    unobstructed: BoolArray,
    limits: RowLimits,
) -> BoolArray:
    """Find windows that complete rows of a selection, and whole rows that it lacks.

    A row is added if the mean probability of its windows reaches a threshold: `ground_threshold` below all others, a
    share of `threshold` between two floors, `threshold` above.

    Parameters
    ----------
    proposals : N proposals.
    selected : indices of the selected proposals.
    probability : (N,) probability of each; 0 excludes a proposal.
    observed : observed elements.
    unobstructed : (N,) bool proposals without obstacles.
    limits : distances and thresholds of a row.

    Returns
    -------
    (N,) bool proposals to add.
    """
    fill = np.zeros(len(proposals.box), bool)
    own = selected[proposals.label[selected] == WINDOW]
    seen = box_array([e for e in observed if e.label == "window"])
    windows = np.concatenate([seen, proposals.box[own]])
    if not len(windows):
        return fill
    solid = np.concatenate(
        [
            box_array([e for e in observed if e.label != "balcony"]),
            proposals.box[selected[proposals.label[selected] != BALCONY]],
        ]
    )
    free = (
        unobstructed & (proposals.label == WINDOW) & (probability > 0) & ~overlap_mask(proposals.box, solid).any(axis=1)
    )
    picked = np.arange(len(windows)) >= len(seen)
    fill[_continue_rows(proposals.box, probability, free, windows, picked, solid)] = True
    windows = np.concatenate([windows, proposals.box[fill]])
    free &= ~overlap_mask(proposals.box, windows).any(axis=1)
    fill[_find_missing_rows(proposals.box, probability, free, windows, limits)] = True
    return fill


def _continue_rows(
    box: Float64Array,
    likely: Float64Array,
    free: BoolArray,
    windows: Float64Array,
    picked: BoolArray,
    solid: Float64Array,
) -> list[int]:
    """Return proposals that repeat the columns of the fuller neighbouring row; `solid` (M, 4) may take their place."""
    height = float(np.median(windows[:, 3] - windows[:, 1]))
    floors, row = cluster_positions_by_gap((windows[:, 1] + windows[:, 3]) / 2, ALIGNMENT_TOLERANCE * height)
    found: list[int] = []
    for r in np.unique(row[picked]).tolist():
        neighbours = [q for q in (r - 1, r + 1) if 0 <= q < len(floors)]
        if not neighbours:
            continue
        other = windows[row == max(neighbours, key=lambda q: int((row == q).sum()))]
        mine = windows[row == r]
        low, high = float(np.median(mine[:, 1])), float(np.median(mine[:, 3]))
        overlap = overlap_mask(
            np.column_stack([other[:, 0], np.full(len(other), low), other[:, 2], np.full(len(other), high)]), solid
        )
        there = np.any(overlap, axis=1)
        if there.mean() < _MIN_NEIGHBOUR_SHARE:
            continue
        for x0, x1 in other[~there][:, [0, 2]].tolist():
            good = (
                free
                & (_interval_iou(box[:, [0, 2]], (x0, x1)) >= _MIN_SIDE_IOU)
                & (_interval_iou(box[:, [1, 3]], (low, high)) >= _MIN_SIDE_IOU)
            )
            if good.any():
                found.append(int(np.where(good, likely, -1.0).argmax()))
    return found


def _find_missing_rows(
    box: Float64Array,
    likely: Float64Array,
    free: BoolArray,
    windows: Float64Array,
    limits: RowLimits,
) -> list[int]:
    """Return proposals of whole missing rows, the likeliest row first."""
    apart, least, standing = limits
    label = np.full(len(box), WINDOW)
    size = np.median(windows[:, 2:] - windows[:, :2], axis=0)
    taken: list[int] = []
    while True:
        floors, row_of = cluster_positions_by_gap(
            (windows[:, 1] + windows[:, 3]) / 2, ALIGNMENT_TOLERANCE * float(size[1])
        )
        columns = [(windows[row_of == k, 0] + windows[row_of == k, 2]) / 2 for k in range(len(floors))]
        pitch = float(np.median(np.diff(floors))) if len(floors) > 1 else 2 * float(size[1])
        middle = (box[:, 1] + box[:, 3]) / 2
        nearest = np.abs(middle[:, None] - floors).argmin(axis=1)
        far = np.abs(middle - floors[nearest]) >= _MIN_ROW_PITCH * pitch
        across = np.array(
            [np.abs(x - columns[k]).min() for x, k in zip((box[:, 0] + box[:, 2]) / 2, nearest, strict=True)]
        )
        on = across < ALIGNMENT_TOLERANCE * size[0]
        index = np.flatnonzero(free & on & far)
        index = index[np.argsort(-likely[index], kind="stable")]
        best, best_sum = np.zeros(0, int), 0.0
        tried: list[int] = []
        for first in index.tolist():
            if any(_interval_iou(box[[first]][:, [1, 3]], tuple(box[k, [1, 3]]))[0] > 0.8 for k in tried):
                continue
            tried.append(first)
            one = index[_interval_iou(box[index][:, [1, 3]], tuple(box[first, [1, 3]])) >= _MIN_SIDE_IOU]
            row = one[select_proposals(box[one], label[one], likely[one], np.ones(len(one), bool), _NO_BOXES, apart)]
            above, below = middle[first] < floors[0], middle[first] > floors[-1]
            enough = standing if below else least if above else _INNER_ROW_FACTOR * least
            value = float(likely[row].sum())
            if (
                len(row) >= _MIN_ROW_COVER * len(columns[nearest[first]])
                and value >= enough * len(row)
                and value > best_sum
            ):
                best, best_sum = row, value
        if not len(best):
            return taken
        taken += best.tolist()
        windows = np.concatenate([windows, box[best]])
        free = free & ~(np.minimum(box[:, None, 3], box[best, 3]) > np.maximum(box[:, None, 1], box[best, 1])).any(
            axis=1
        )


def _interval_iou(sides: Float64Array, side: tuple[float, float]) -> Float64Array:
    """Return the (N,) intersection over union of intervals (N, 2) with one interval."""
    both = np.minimum(sides[:, 1], side[1]) - np.maximum(sides[:, 0], side[0])
    iou: Float64Array = np.clip(both, 0, None) / (np.maximum(sides[:, 1], side[1]) - np.minimum(sides[:, 0], side[0]))
    return iou


def min_window_gap(observed: Sequence[Element]) -> float:
    """Return the smallest distance between windows of one floor, from the observed ones.

    It is a share of the smallest observed gap, bounded by a share of the window width; a share of the width alone if
    no floor shows two windows.
    """
    box = box_array([e for e in observed if e.label == "window"])
    if not len(box):
        return 0.0
    width = float(np.median(box[:, 2] - box[:, 0]))
    gap = box[None, :, 0] - box[:, None, 2]
    tall = box[:, 3] - box[:, 1]
    shared = np.minimum(box[:, None, 3], box[:, 3]) - np.maximum(box[:, None, 1], box[:, 1])
    neighbours = (shared > 0.3 * np.minimum(tall[:, None], tall)) & (gap > -0.05 * width)
    if not neighbours.any():
        return _SINGLE_GAP_SHARE * width
    return max(0.0, min(_MAX_GAP_SHARE * width, _OBSERVED_GAP_SHARE * float(gap[neighbours].min())))
