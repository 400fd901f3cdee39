"""What a city will cost before it is run: a model of seconds, bytes and commits, fitted on runs by `benchmarks.city.cost`."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import cache
from pathlib import Path
from typing import Any

from tasks.city.block_counts import NOTHING, Counts

COEFFICIENTS = Path(__file__).with_name("cost.json")
WHAT = tuple(field.name for field in fields(Counts))
WORDS = {
    "facades": "facades",
    "viewpoints": "viewpoints of streets",
    "ground": "ground",
    "megatexels": "texels: half as many a metre are a quarter",
    "megapixels": "pixels of panoramas: half as wide are a quarter",
    "exemplars": "exemplars, prepared by each block",
    "blocks": "starting blocks and publishing them, which workers wait for",
}


@dataclass(frozen=True)
class Cost:
    """The model. fitted: when, on which machine, by how many blocks of which density (texels a metre); error: by which share of
    them seconds, bytes and commits were off at most on blocks that it was not fitted on; error_planned: likewise, with
    facades and texels by the plan.

    counted: of each of WHAT how many there are for one that the map tells of; seconds, bytes, commits: what one takes: seconds
    of a processor that does nothing else, bytes kept in store and published.
    """

    fitted: Mapping[str, Any]
    counted: Counts
    seconds: Counts
    bytes: Counts
    commits: Counts

    def seconds_of(self, counts: Counts, workers: int) -> float:
        """Seconds of the clock that blocks take one after the other: workers share the units, and wait as a block starts and
        ends."""
        spent = counts.times(self.seconds)
        return spent.blocks + (sum(asdict(spent).values()) - spent.blocks) / workers

    def estimate(
        self, told: Sequence[Counts], workers: int, at_once: int = 1, planned: Sequence[Mapping[str, float]] = ()
    ) -> dict[str, Any]:
        """What blocks will take, by what the map tells of each: facades and the like, hours on processors that do nothing else,
        gigabytes, commits, and where most of the time goes.

        planned: of each block what its plan knows, in place of what the map tells; none where no plan was made.
        """
        blocks = [one.times(self.counted) for one in told]
        if planned:
            blocks = [replace(one, **known) for one, known in zip(blocks, planned, strict=True)]
        counts = sum(blocks, NOTHING)
        spent = counts.times(self.seconds)
        shares = asdict(spent) | {name: getattr(spent, name) / workers for name in WHAT if name != "blocks"}
        longest = max((self.seconds_of(one, workers) for one in blocks), default=0.0)
        hours = max(self.seconds_of(counts, workers) / max(1, min(at_once, len(told))), longest) / 3600
        most = max(shares, key=lambda name: shares[name])
        return {
            **{name: round(getattr(counts, name)) for name in WHAT},
            "workers": workers * at_once,
            "hours": float(f"{hours:.3g}"),
            "processor_hours": float(f"{sum(asdict(spent).values()) / 3600:.3g}"),
            "gigabytes": float(f"{sum(asdict(counts.times(self.bytes)).values()) / 1e9:.3g}"),
            "commits": round(sum(asdict(counts.times(self.commits)).values())),
            "bottleneck": WORDS[most],
            "bottleneck_share": round(shares[most] / max(sum(shares.values()), 1e-9), 2),
            "fitted": dict(self.fitted),
        }


@cache
def shipped() -> Cost:
    """The model as it was fitted last."""
    return cost_of(json.loads(COEFFICIENTS.read_text(encoding="utf-8")))


def cost_of(held: Mapping[str, Any]) -> Cost:
    """A model as it is kept in a file."""
    parts = {name: Counts(**held[name]) for name in ("counted", "seconds", "bytes", "commits")}
    return Cost(fitted=held["fitted"], **parts)
