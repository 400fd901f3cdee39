"""An estimate follows from counts, the clock from workers and blocks at a time; a fit finds the model that made the figures."""

from __future__ import annotations

from dataclasses import asdict, replace

import pytest

from benchmarks.city.cost import Ran, checked, fit
from tasks.city.cost import Cost, shipped
from tasks.city.counting import Counts

MODEL = Cost(
    fitted={},
    counted=Counts(1.0, 1.0, 2.0, 1.0, 1.0),
    seconds=Counts(0.8, 0.5, 0.0, 0.0, 0.25, blocks=30.0),
    bytes=Counts(0.0, 1e5, 0.0, 0.0, 2e6, blocks=0.0),
    commits=Counts(1.5, 0.5, 0.0, 0.0, 0.0, blocks=3.0),
)
TOLD = [Counts(40 + 17 * n % 60, 10 + 23 * n % 50, 5 + 7 * n % 11, 4 + n % 3, 3.0 + 5 * n % 13) for n in range(12)]


def ran(told: Counts) -> Ran:
    """A block as the model has it; what starting it takes is measured apart."""
    had = told.times(MODEL.counted)
    seconds, size, commits = (
        sum(asdict(had.times(one)).values()) for one in (replace(MODEL.seconds, blocks=0.0), MODEL.bytes, MODEL.commits)
    )
    return Ran("", 32.0, told, had, seconds, size, commits)


def test_a_fit_finds_the_model_and_holds_on_blocks_it_has_not_seen() -> None:
    found = fit([ran(told) for told in TOLD[:8]], 30.0)
    for name in ("counted", "seconds", "bytes", "commits"):
        assert asdict(getattr(found, name)) == pytest.approx(asdict(getattr(MODEL, name)), rel=0.01, abs=0.01)
    assert all(
        one["of_it"] == pytest.approx(1, abs=0.02) for one in checked(found, [ran(t) for t in TOLD[8:]], 30.0).values()
    )


def test_density_and_starting_are_terms_of_their_own() -> None:
    sparse, dense = (replace(TOLD[0], megatexels=TOLD[0].megatexels * factor) for factor in (1, 16))
    gigabytes = [MODEL.estimate([one] * 100, 2)["gigabytes"] for one in (sparse, dense)]
    assert gigabytes[1] > 8 * gigabytes[0]
    assert MODEL.estimate([replace(sparse, blocks=2.0)], 2)["hours"] > MODEL.estimate([sparse], 2)["hours"]


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
