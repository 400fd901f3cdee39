"""Reasons for skips: what a machine lacks is known, all else fails the suite."""

from __future__ import annotations

from tests.skips import find_unknown_reasons


def test_only_reasons_that_are_not_listed_count() -> None:
    known = [
        "Skipped: no Chromium on this machine; `make clients` brings one",
        "Skipped: no field inputs in the data folder",
    ]
    assert find_unknown_reasons(known) == {}
    assert find_unknown_reasons([*known, "it fails here", "it fails here"]) == {"it fails here": 2}
