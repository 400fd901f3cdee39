"""Facts by which the report describes a night of a deployment."""

from __future__ import annotations

from benchmarks.nights.report import count_units


def test_units_are_those_of_the_lines_that_close_stages() -> None:
    log = [
        "info: exemplars: 2 done, 0 done before, 0 failed",
        "warning: facades: a photo is cut off",
        "info: facades: 4 done, 16 done before, 1 failed",
    ]
    assert count_units(log) == {"done": 6, "kept": 16, "failed": 1}
    assert count_units([]) == {"done": 0, "kept": 0, "failed": 0}
