"""Ground floor of a completion: a row of shops of one size, or none."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, Int64Array
from facade_core.facade.layout.proposals import Proposals
from facade_core.facade.layout.rectangles import SHOP

# Size step of shops of one row (natural logarithm).
_SIZE_TOLERANCE = 0.1


def select_shop_row(
    proposals: Proposals, probability: Float64Array, unobstructed: BoolArray, threshold: float
) -> Int64Array:
    """Select the disjoint shops of one size whose probabilities exceed the threshold by the largest sum.

    Sizes are those of observed shops, of the database, and one or two column pitches less a pier (`proposals`).

    Parameters
    ----------
    proposals : N proposals.
    probability : (N,) probability of each.
    unobstructed : (N,) bool proposals without obstacles.
    threshold : probability from which a shop counts in favour of its row.

    Returns
    -------
    Indices of the shops; empty if none is unobstructed.
    """
    index = np.flatnonzero((proposals.label == SHOP) & unobstructed)
    if not len(index):
        return index
    box = proposals.box[index]
    size = np.rint(np.log(box[:, 2:] - box[:, :2]) / _SIZE_TOLERANCE)
    _, group = np.unique(size, axis=0, return_inverse=True)
    rows = [_disjoint_shops(proposals.box, probability, index[group.ravel() == k]) for k in range(group.max() + 1)]
    return max(rows, key=lambda row: float((probability[row] - threshold).sum()))


def _disjoint_shops(box: Float64Array, likely: Float64Array, index: Int64Array) -> Int64Array:
    kept: list[int] = []
    for k in index[np.argsort(-likely[index], kind="stable")].tolist():
        if all(box[k, 0] >= box[other, 2] or box[other, 0] >= box[k, 2] for other in kept):
            kept.append(k)
    return np.array(kept, int)
