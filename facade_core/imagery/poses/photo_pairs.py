"""Pairs of photos that may overlap, by their order and places."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Float64Array, Int64Array
from facade_core.imagery.poses.settings import PHOTO_PAIRS


def choose_pairs(places: Float64Array) -> Int64Array:
    """Choose the pairs of photos to compare: neighbours by order, and by place.

    Parameters
    ----------
    places : (n, 2) measured places in the order of their names, metres; NaN where unknown.

    Returns
    -------
    (k, 2) numbers of photos, the lower first, each pair once, in order.
    """
    from scipy.spatial import KDTree

    count = len(places)
    pairs = {
        (one, other)
        for one in range(count)
        for other in range(one + 1, min(one + PHOTO_PAIRS.next_photos, count - 1) + 1)
    }
    known = np.flatnonzero(np.isfinite(places).all(axis=1))
    if len(known) > 1:
        nearest = min(PHOTO_PAIRS.nearest_photos + 1, len(known))
        tree = KDTree(places[known])
        away, neighbour = tree.query(places[known], k=nearest, distance_upper_bound=PHOTO_PAIRS.max_pair_distance_m)
        rows, columns = np.nonzero(np.isfinite(away))
        for one, other in zip(known[rows].tolist(), known[neighbour[rows, columns]].tolist(), strict=True):
            if one != other:
                pairs.add((min(one, other), max(one, other)))
    return np.array(sorted(pairs), np.int64).reshape(-1, 2)
