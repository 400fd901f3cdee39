"""What a city will cost before it is run: a model of seconds, bytes and commits, fitted on runs by `benchmarks.city.cost`."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import cache
from pathlib import Path
from typing import Any

from tasks.city.block_counts import NO_COUNTS, BlockCounts

COEFFICIENTS = Path(__file__).with_name("cost.json")
COUNT_NAMES = tuple(field.name for field in fields(BlockCounts))
BOTTLENECK_TEXTS = {
    "facades": "facades",
    "viewpoints": "viewpoints of streets",
    "ground": "ground",
    "megatexels": "texels: half as many a metre are a quarter",
    "megapixels": "pixels of panoramas: half as wide are a quarter",
    "exemplars": "exemplars, prepared by each block",
    "blocks": "starting blocks and publishing them, which workers wait for",
}


@dataclass(frozen=True)
class CostModel:
    """The model. fitted: when, on which machine, by how many blocks of which density (texels a metre); error: by which share of
    them seconds, bytes and commits were off at most on blocks that it was not fitted on; error_planned: likewise, with
    facades and texels by the plan.

    counted: of each of WHAT how many there are for one that the map tells of; seconds, bytes, commits: what one takes: seconds
    of a processor that does nothing else, bytes kept in store and published.
    """

    fitted: Mapping[str, Any]
    counted: BlockCounts
    seconds: BlockCounts
    bytes: BlockCounts
    commits: BlockCounts

    def clock_seconds(self, counts: BlockCounts, workers: int) -> float:
        """Seconds of the clock that blocks take one after the other: workers share the units, and wait as a block starts and
        ends."""
        spent = counts.multiply(self.seconds)
        return spent.blocks + (sum(asdict(spent).values()) - spent.blocks) / workers

    def estimate(
        self, counts_by_block: Sequence[BlockCounts], workers: int, at_once: int = 1, planned: Sequence[Mapping[str, float]] = ()
    ) -> dict[str, Any]:
        """What blocks will take, by what the map tells of each: facades and the like, hours on processors that do nothing else,
        gigabytes, commits, and where most of the time goes.

        planned: of each block what its plan knows, in place of what the map tells; none where no plan was made.
        """
        blocks = [one.multiply(self.counted) for one in counts_by_block]
        if planned:
            blocks = [replace(one, **known) for one, known in zip(blocks, planned, strict=True)]
        counts = sum(blocks, NO_COUNTS)
        spent = counts.multiply(self.seconds)
        shares = asdict(spent) | {name: getattr(spent, name) / workers for name in COUNT_NAMES if name != "blocks"}
        longest = max((self.clock_seconds(one, workers) for one in blocks), default=0.0)
        hours = max(self.clock_seconds(counts, workers) / max(1, min(at_once, len(counts_by_block))), longest) / 3600
        most = max(shares, key=lambda name: shares[name])
        return {
            **{name: round(getattr(counts, name)) for name in COUNT_NAMES},
            "workers": workers * at_once,
            "hours": float(f"{hours:.3g}"),
            "processor_hours": float(f"{sum(asdict(spent).values()) / 3600:.3g}"),
            "gigabytes": float(f"{sum(asdict(counts.multiply(self.bytes)).values()) / 1e9:.3g}"),
            "commits": round(sum(asdict(counts.multiply(self.commits)).values())),
            "bottleneck": BOTTLENECK_TEXTS[most],
            "bottleneck_share": round(shares[most] / max(sum(shares.values()), 1e-9), 2),
            "fitted": dict(self.fitted),
        }


@cache
def load_cost_model() -> CostModel:
    """The model as it was fitted last."""
    return parse_cost_model(json.loads(COEFFICIENTS.read_text(encoding="utf-8")))


def parse_cost_model(held: Mapping[str, Any]) -> CostModel:
    """A model as it is kept in a file."""
    parts = {name: BlockCounts(**held[name]) for name in ("counted", "seconds", "bytes", "commits")}
    return CostModel(fitted=held["fitted"], **parts)
