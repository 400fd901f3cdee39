"""An estimate follows from counts, the clock from workers and blocks at a time; a fit finds the model that made the figures."""

from __future__ import annotations

from dataclasses import asdict, replace

import pytest

from benchmarks.city.laying import COMMAND, COURSE, KEPT_SECONDS, Ran, errors, fit, of_it
from tasks.city.block_counts import BlockCounts, share_exemplars
from tasks.city.cost import CostModel, load_cost_model

MODEL = CostModel(
    fitted={},
    counted=BlockCounts(1.0, 1.0, 2.0, 1.0, 1.0, megapixels=1.0),
    seconds=BlockCounts(0.8, 0.5, 0.2, 0.4, 0.25, blocks=30.0, megapixels=1.5),
    bytes=BlockCounts(0.0, 1e5, 0.0, 0.0, 2e6, blocks=0.0, megapixels=3e5),
    commits=BlockCounts(1.5, 0.5, 0.0, 0.0, 0.0, blocks=3.0),
)
TOLD = [
    BlockCounts(
        40 + 17 * n % 60, 10 + 23 * n % 50, 5 + 7 * n % 11, 4 + n % 3, 3.0 + 5 * n % 13, megapixels=1.0 + 11 * n % 17
    )
    for n in range(12)
]


def ran(told: BlockCounts) -> Ran:
    """A block as the model has it, its seconds by the stages in which they are spent."""
    had = told.multiply(MODEL.counted)
    spent = asdict(had.multiply(MODEL.seconds))
    seconds = {
        "exemplars": spent["exemplars"],
        "facades": spent["facades"] + spent["megatexels"],
        "viewpoints": spent["viewpoints"] + spent["megapixels"],
        "surfaces": spent["ground"],
        COURSE: spent["blocks"],
    }
    size, commits = (sum(asdict(had.multiply(one)).values()) for one in (MODEL.bytes, MODEL.commits))
    return Ran("", 32.0, told, had, seconds, {"store": size}, {"commits": commits})


def test_a_fit_finds_the_model_and_holds_on_blocks_it_has_not_seen() -> None:
    found = fit([ran(told) for told in TOLD[:8]])
    for name in ("counted", "seconds", "bytes", "commits"):
        expected = asdict(getattr(MODEL, name))
        if name == "counted":  # 1 where the map has none
            expected |= {count: 1.0 for count, factor in expected.items() if count == "blocks" or not factor}
        if name == "seconds":
            expected |= {count: getattr(load_cost_model().seconds, count) for count in KEPT_SECONDS}
        assert asdict(getattr(found, name)) == pytest.approx(expected, rel=0.01, abs=0.01)
    held = [of_it(found, ran(told)) for told in TOLD[8:]]
    assert max(errors(held).values()) < 0.02
    worse = replace(ran(TOLD[8]), seconds={COMMAND: 2 * ran(TOLD[8]).all_of("seconds")})
    assert errors([*held, of_it(found, worse)])["seconds"] == pytest.approx(0.5, abs=0.02)


def test_what_the_command_takes_beside_is_laid_to_blocks_facades_and_texels() -> None:
    """Of three blocks what it took beside their stages is known: 20 s, .1 s a facade, .5 s a million texels."""
    blocks = [ran(told) for told in TOLD[:8]]
    beside = [
        replace(one, seconds={COMMAND: 20 + 0.1 * one.had.facades + 0.5 * one.had.megatexels}, bytes={}, commits={})
        for one in (blocks[0], blocks[3], blocks[5])
    ]
    found, alone = fit([*blocks, *beside]), fit(blocks)
    assert found.seconds.blocks - alone.seconds.blocks == pytest.approx(20, rel=0.02)
    assert found.seconds.facades - alone.seconds.facades == pytest.approx(0.1, rel=0.05)
    assert found.seconds.megatexels - alone.seconds.megatexels == pytest.approx(0.5, rel=0.05)
    assert found.fitted["blocks"] == 8


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
    waits = sum(asdict(MODEL.seconds)["blocks"] * told.blocks for told in TOLD) / 3600
    assert one - four == pytest.approx(waits * 3 / 4, rel=0.01), "blocks start side by side, and share the workers"
    assert MODEL.estimate(TOLD, 1, 4)["hours"] == pytest.approx(MODEL.estimate(TOLD, 1)["hours"] / 4, rel=0.01)
    assert many >= max(MODEL.clock_seconds(told, 2) for told in share_exemplars(TOLD)) / 3600 * 0.99


def test_the_model_that_is_shipped_can_be_read() -> None:
    assert load_cost_model().estimate(TOLD, 2)["hours"] > 0
    assert {"on", "machine", "error"} <= load_cost_model().fitted.keys()
    assert {"seconds", "bytes", "commits"} == load_cost_model().fitted["error"].keys()
