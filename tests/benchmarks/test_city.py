"""What the city benchmark counts, on a timetable made by hand, and what it draws."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest

from benchmarks.city.figures import not_busy, ratios
from benchmarks.city.plot import LINES, plot
from benchmarks.city.runs import Look

# Two workers from 10 to 30 of 40 seconds; worker 1 rests from 15 to 20 and ends at 25.
UNITS = {"0": [(10.0, 18.0), (18.0, 30.0)], "1": [(10.0, 15.0), (20.0, 25.0)]}


def test_fewer_than_nine_tenths_of_the_workers_are_not_busy() -> None:
    found = not_busy(UNITS, 2, [0.0, 10.0, 30.0, 40.0])
    assert found == pytest.approx({"all": 0.75, "before": 0.25, "among": 0.25, "after": 0.25})


def test_one_worker_of_eleven_may_rest() -> None:
    units = {str(worker): [(0.0, 10.0)] for worker in range(10)} | {"10": [(0.0, 1.0)]}
    assert not_busy(units, 11, [0.0, 0.0, 10.0, 10.0])["all"] == 0
    assert not_busy(units, 12, [0.0, 0.0, 10.0, 10.0])["all"] == pytest.approx(0.9)


def test_ratios_are_of_figures_that_both_have() -> None:
    first = {
        "seconds": 10.0,
        "stages": {"facades": {"unit_s": 2.0}, "tiles": {"unit_s": 1.0}},
        "digest": "a",
        "none": 0,
    }
    last = {"seconds": 30.0, "stages": {"facades": {"unit_s": 2.2}}, "digest": "b", "none": 3}
    assert ratios(first, last) == {"seconds": 3.0, "stages": {"facades": {"unit_s": 1.1}}}


def test_memory_is_drawn_on_one_scale(tmp_path: Path) -> None:
    runs = {
        "1x": [Look(0.0, 100.0, (50.0,), 200.0), Look(2.0, 120.0, (), 150.0)],
        "9x": [Look(5.0, 10.0, (900.0, 1.0), 1000.0)],
    }
    plot(runs, tmp_path / "city.svg")
    drawn = ElementTree.parse(tmp_path / "city.svg").getroot()
    lines = drawn.findall("{*}polyline")
    assert len(lines) == len(runs) * len(LINES)
    highest = [min(float(point.split(",")[1]) for point in str(line.get("points")).split()) for line in lines]
    frames = [float(str(frame.get("y"))) for frame in drawn.findall("{*}rect") if frame.get("y")]
    assert highest[0] > frames[0]
    assert highest[len(LINES)] == frames[1]
