"""Choices among equals: the first of those that differ by no more than rounding."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

# Share of the largest value below which differences are rounding; sums in double precision are a million times finer.
ROUNDING_SHARE = 1e-9


def first_minimum(values: ArrayLike, tolerance: float | None = None) -> int:
    """Return the index of the first value that exceeds the smallest by no more than a tolerance.

    Values that are equal but for their rounding have the same winner on every processor and in every order of sums.

    Parameters
    ----------
    values : (n,) without NaN; infinite ones count last.
    tolerance : in the unit of the values; ROUNDING_SHARE of the largest finite magnitude by default.

    Raises
    ------
    ValueError : no values.
    """
    array = np.asarray(values, np.float64).ravel()
    least = array.min()
    if tolerance is None:
        tolerance = ROUNDING_SHARE * float(np.abs(array, where=np.isfinite(array), out=np.zeros(len(array))).max())
    return int(np.argmax(array <= least + tolerance))


def first_maximum(values: ArrayLike) -> int:
    """Return the index of the first of the largest values, as `first_minimum` of the smallest."""
    return first_minimum(-np.asarray(values, np.float64))
