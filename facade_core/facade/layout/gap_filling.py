"""Complete rows and columns of a selection: fill gaps of nearly full lines, remove single windows and balconies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, Int64Array
from facade_core.core.types import Element
from facade_core.facade.layout.facade_frame import cluster_positions_by_gap
from facade_core.facade.layout.grids import ALIGNMENT_TOLERANCE, box_array
from facade_core.facade.layout.proposals import Proposals
from facade_core.facade.layout.rectangles import WINDOW, overlap_mask

# Smallest occupied share of the row and of the column of a filled cell.
_MIN_FILLED_SHARE = 0.5
# Smallest occupied share of a row without observed windows.
_MIN_ROW_SHARE = 0.26
# A balcony without a window stays from this probability on.
_MIN_LONE_BALCONY = 0.4
# A balcony belongs to a window if it covers this share of the window's width ...
_MIN_SHARED_WIDTH = 0.5
# ... and which it meets between these heights, in window heights from the window's top.
_BALCONY_REACH = (0.4, 1.6)


def find_fillers_and_strays(
    proposals: Proposals,
    selected: Int64Array,
    probability: Float64Array,
    observed: Sequence[Element],
    obstacles: Float64Array,
) -> tuple[BoolArray, BoolArray]:
    """Find proposals that fill gaps of a selection, and its windows isolated in their row.

    Parameters
    ----------
    proposals : N proposals.
    selected : indices of the selected proposals.
    probability : (N,) probability of each; decides between several for one cell; 0 excludes a proposal.
    observed : observed elements.
    obstacles : (M, 4) boxes that no proposal may overlap.

    Returns
    -------
    (N,) bool windows that fill gaps, and (N,) bool selected windows to remove.
    """
    fill, alone = np.zeros(len(proposals.box), bool), np.zeros(len(proposals.box), bool)
    own = selected[proposals.label[selected] == WINDOW]
    box = np.concatenate([box_array([e for e in observed if e.label == "window"]), proposals.box[own]])
    if not len(own):
        return fill, alone
    centre, size = (box[:, :2] + box[:, 2:]) / 2, np.median(box[:, 2:] - box[:, :2], axis=0)
    (x, column), (y, row) = (
        cluster_positions_by_gap(centre[:, axis], ALIGNMENT_TOLERANCE * float(size[axis])) for axis in (0, 1)
    )
    taken = np.zeros((len(y), len(x)), bool)
    taken[row, column] = True
    free = (proposals.label == WINDOW) & (probability > 0)
    if len(obstacles):
        free &= ~overlap_mask(proposals.box, obstacles).any(axis=1)
    index = np.flatnonzero(free)
    index = index[np.argsort(-probability[index], kind="stable")]
    middle = (proposals.box[index, :2] + proposals.box[index, 2:]) / 2
    away = [np.abs(middle[:, axis, None] - at) < ALIGNMENT_TOLERANCE * size[axis] for axis, at in ((0, x), (1, y))]
    cell = np.full(taken.shape, -1)
    for r, c in np.argwhere(~taken).tolist():
        there = np.flatnonzero(away[0][:, c] & away[1][:, r])
        if len(there):
            cell[r, c] = index[there[0]]
    wide = taken | (cell >= 0)
    in_row, in_column = (taken.sum(axis=a) / wide.sum(axis=a) for a in (1, 0))
    gaps = (cell >= 0) & (in_row[:, None] >= _MIN_FILLED_SHARE) & (in_column >= _MIN_FILLED_SHARE)
    fill[cell[gaps]] = True
    shown = np.zeros(len(y), bool)
    shown[row[: len(box) - len(own)]] = True
    lonely = ~shown & (in_row < _MIN_ROW_SHARE)
    alone[own[lonely[row[len(box) - len(own) :]]]] = True
    return fill, alone


def remove_lone_balconies(layout: Sequence[Element], observed: Sequence[Element]) -> tuple[Element, ...]:
    """Return proposed elements without the unlikely balconies that belong to no window, proposed or observed."""
    window = box_array([e for e in (*layout, *observed) if e.label == "window"])
    width, height = (window[:, 2:] - window[:, :2]).T
    top, bottom = (window[:, 1] + reach * height for reach in _BALCONY_REACH)

    def has_window(e: Element) -> bool:
        shared = np.minimum(window[:, 2], e.x1) - np.maximum(window[:, 0], e.x0)
        return bool(((shared > _MIN_SHARED_WIDTH * width) & (e.y0 < bottom) & (e.y1 > top)).any())

    return tuple(e for e in layout if e.label != "balcony" or e.confidence >= _MIN_LONE_BALCONY or has_window(e))
