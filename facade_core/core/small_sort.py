"""Sorting of a few values inside kernels, where numba's own sort takes seconds to compile."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Float64Array, Int64Array
from facade_core.core.numba_cache import njit


@njit(cache=True)
def argsort_few(values: Float64Array) -> Int64Array:
    """Return the stable ascending order (k,) of a few values (k,)."""
    order = np.empty(len(values), np.int64)
    for i in range(len(values)):
        j = i
        while j > 0 and values[order[j - 1]] > values[i]:
            order[j] = order[j - 1]
            j -= 1
        order[j] = i
    return order
