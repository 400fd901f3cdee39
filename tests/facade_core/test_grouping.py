"""Rows by value, against comparing the whole column."""

from __future__ import annotations

import numpy as np
import pytest

from facade_core.core.grouping import RowsByValue


@pytest.mark.parametrize("kind", [np.int32, np.int64])
def test_rows_are_those_that_a_comparison_selects(kind: type) -> None:
    column = np.random.default_rng(2).integers(-1, 12, 500).astype(kind)
    column[column == 7] = 3
    grouped = RowsByValue(column)
    for value in range(-3, 15):
        assert grouped.rows_with(value).tolist() == np.flatnonzero(column == value).tolist()
    for values in ([], [3], [7], [11, 3, 3, -1, 40], range(-5, 20)):
        wanted = np.flatnonzero(np.isin(column, list(values))).tolist()
        assert grouped.rows_with_any(np.array(values, np.int64)).tolist() == wanted


def test_an_empty_column_has_no_rows() -> None:
    grouped = RowsByValue(np.zeros(0, np.int64))
    assert len(grouped.rows_with(0)) == len(grouped.rows_with_any(np.arange(3))) == 0
