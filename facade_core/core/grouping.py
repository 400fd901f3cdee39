"""Index of table rows by the value of an integer column."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Int64Array, IntArray


class RowsByValue:
    """Lookup of table rows by the value of an integer column (n,), without a scan per query."""

    def __init__(self, column: IntArray) -> None:
        self._order = np.argsort(column, kind="stable")
        self._values = column[self._order].astype(np.int64)  # the dtype of queries, so that none converts the column

    def rows_with(self, value: int) -> Int64Array:
        """Return the rows (k,) with a value, ascending."""
        first, last = np.searchsorted(self._values, (value, value + 1))
        return self._order[first:last]

    def rows_with_any(self, values: IntArray) -> Int64Array:
        """Return the rows (k,) with any of the values (v,), ascending; repeated values count once."""
        values = np.unique(values)
        first, last = (np.searchsorted(self._values, values, side) for side in ("left", "right"))
        count = last - first
        at = np.repeat(first - np.cumsum(count) + count, count) + np.arange(int(count.sum()))
        return np.sort(self._order[at])


def group_rows(values: IntArray) -> dict[int, Int64Array]:
    """Return the ascending rows of each distinct value of an integer column (n,)."""
    order = np.argsort(values, kind="stable")
    different, first = np.unique(values[order], return_index=True)
    return dict(zip(different.tolist(), np.split(order, first[1:]), strict=True)) if len(values) else {}
