"""An estimate follows from counts, the clock from workers and blocks at a time; a fit finds the model that made the figures."""

from __future__ import annotations

from dataclasses import asdict, replace

import pytest

from benchmarks.city.cost import Block, checked, fit
from tasks.city.cost import Cost, shipped
from tasks.city.counting import Counts

MODEL = Cost(
    fitted={},
    counted=Counts(1.0, 1.0, 2.0, 1.0),
    seconds=Counts(2.0, 0.5, 0.25, 1.0, blocks=30.0),
    bytes=Counts(3e6, 1e5, 2e5, 1e5, blocks=5e6),
    commits=Counts(1.5, 0.5, 1.0, 1.0, blocks=3.0),
    slower=1.5,
)
TOLD = [Counts(40 + 17 * n % 60, 10 + 23 * n % 50, 5 + 7 * n % 11, 4 + n % 3) for n in range(12)]


def ran(told: Counts) -> Block:
    """A block as the model has it, on two workers."""
    had = told.times(MODEL.counted)
    spent, size = replace(had.times(MODEL.seconds), blocks=0.0), round(sum(asdict(had.times(MODEL.bytes)).values()))
    return Block(told, had, spent, had.times(MODEL.commits), size, MODEL.seconds_of(had, 2), 32.0)


def test_a_fit_finds_the_model_and_holds_on_blocks_it_has_not_seen() -> None:
    found = fit([ran(told) for told in TOLD[:8]], workers=2)
    for name in ("counted", "seconds", "commits"):
        assert asdict(getattr(found, name)) == pytest.approx(asdict(getattr(MODEL, name)), rel=0.01)
    assert found.slower == pytest.approx(MODEL.slower, rel=0.01)
    assert all(
        one["of_it"] == pytest.approx(1, abs=0.02) for one in checked(found, [ran(t) for t in TOLD[8:]], 2).values()
    )


def test_more_workers_leave_what_they_wait_for() -> None:
    hours = [MODEL.estimate(TOLD, workers)["hours"] for workers in (1, 2, 1000)]
    assert hours[0] > hours[1] > hours[2] == pytest.approx(12 * 30 / 3600, rel=0.05)
    assert MODEL.estimate(TOLD, 1000)["bottleneck"].startswith("starting blocks")
    assert MODEL.estimate(TOLD, 1)["bottleneck"] == "facades"


def test_no_more_blocks_than_there_are_go_at_a_time() -> None:
    one, four, many = (MODEL.estimate(TOLD, 2, at_once)["hours"] for at_once in (1, 4, 10_000))
    assert one / 4 == pytest.approx(four, rel=0.01)
    assert many >= max(MODEL.seconds_of(told.times(MODEL.counted), 2) for told in TOLD) / 3600 * 0.99


def test_the_model_that_is_shipped_can_be_read() -> None:
    assert shipped().estimate(TOLD, 2)["hours"] > 0
    assert {"on", "machine"} <= shipped().fitted.keys()
