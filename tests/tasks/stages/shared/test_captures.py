"""The panoramas of a facade, where its street was captured more than once."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from tasks.stages.shared.captures import split_panoramas_by_capture


@pytest.mark.parametrize(
    ("days", "newest", "before"),
    [
        ({}, (5, 3, 8, 1), ()),
        ({5: "2024-05-17", 1: "2024-05-17"}, (5, 3, 8, 1), ()),
        ({5: "2024-05-17", 3: "2024-06-10", 8: "2024-07-03"}, (5, 3, 8, 1), ()),
        ({5: "2021-05-17", 3: "2024-05-17", 8: "2021-05-18"}, (3, 1, 2, 7), (5, 8)),
        ({5: "2021-05-17", 3: "2024-05-17", 8: "2019-05-18", 1: "2019-05-18"}, (3, 2, 7), (5,)),
        ({5: "2024-04-17", 3: "2024-05-17"}, (3, 8, 1, 2), (5,)),
    ],
    ids=["no day is known", "one day", "one capture of weeks", "two captures", "three", "a month apart"],
)
def test_the_newest_capture_counts_and_the_one_before_is_compared(
    days: Mapping[int, str], newest: tuple[int, ...], before: tuple[int, ...]
) -> None:
    found = split_panoramas_by_capture([5, 3, 8, 1, 2, 7], days)
    assert (found.newest, found.before) == (newest, before)
