"""Path of the seam between a patch and its surroundings."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Float64Array, Int64Array
from facade_core.core.numba_cache import njit


@njit(cache=True)
def find_min_error_path(error: Float64Array) -> Int64Array:
    """Find the path of least error along the first axis, with steps of at most 1 (minimum-error cut).

    Parameters
    ----------
    error : (n, k) float64.

    Returns
    -------
    (n,) int64 index along the second axis.
    """
    length, wide = error.shape
    total = error.copy()
    for a in range(1, length):
        for b in range(wide):
            best = total[a - 1, b]
            if b > 0:
                best = min(best, total[a - 1, b - 1])
            if b + 1 < wide:
                best = min(best, total[a - 1, b + 1])
            total[a, b] += best
    path = np.empty(length, np.int64)
    for a in range(length - 1, -1, -1):
        if a == length - 1:
            path[a] = np.argmin(total[a])
            continue
        b = path[a + 1]
        for other in (b - 1, b + 1):
            if 0 <= other < wide and total[a, other] < total[a, b]:
                b = other
        path[a] = b
    return path
