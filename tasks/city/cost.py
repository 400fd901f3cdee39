"""Cost model of a city: seconds, bytes and commits, fitted on runs by `benchmarks.city.cost`."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import cache
from pathlib import Path

from facade_core.core.json_types import JsonObject
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
    """Cost of a block as a linear function of its counts.

    Attributes
    ----------
    fitted : date, machine, blocks and texel density of the fit; `error`: largest relative error of seconds, bytes and
        commits on blocks outside the fit; `error_planned`: the same with facades and texels from the plan.
    counted : actual count for each count of the map.
    seconds : processor seconds for one of each count, on an idle processor.
    bytes : bytes of store and publication for one of each count.
    commits : commits for one of each count.
    """

    fitted: JsonObject
    counted: BlockCounts
    seconds: BlockCounts
    bytes: BlockCounts
    commits: BlockCounts

    def clock_seconds(self, counts: BlockCounts, workers: int) -> float:
        """Compute the wall-clock seconds of blocks that run one after another.

        Workers share the units, and wait while a block starts and ends.

        Parameters
        ----------
        counts : sum of the counts of the blocks.
        workers : workers of one block.
        """
        spent = counts.multiply(self.seconds)
        total: float = sum(asdict(spent).values())
        return spent.blocks + (total - spent.blocks) / workers

    def estimate(
        self,
        counts_by_block: Sequence[BlockCounts],
        workers: int,
        at_once: int = 1,
        planned: Sequence[Mapping[str, float]] = (),
    ) -> JsonObject:
        """Predict counts, hours, gigabytes, commits and the bottleneck of some blocks.

        Parameters
        ----------
        counts_by_block : counts of each block from the map.
        workers : workers of one block.
        at_once : blocks that run at the same time.
        planned : counts of each block from its plan, which replace those of the map; empty without a plan.
        """
        blocks = [counts_of_block.multiply(self.counted) for counts_of_block in counts_by_block]
        if planned:
            blocks = [replace(counts_of_block, **known) for counts_of_block, known in zip(blocks, planned, strict=True)]
        counts = sum(blocks, NO_COUNTS)
        spent = counts.multiply(self.seconds)
        shares = asdict(spent) | {name: getattr(spent, name) / workers for name in COUNT_NAMES if name != "blocks"}
        longest = max((self.clock_seconds(counts_of_block, workers) for counts_of_block in blocks), default=0.0)
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
    """Load the newest fitted model."""
    return parse_cost_model(json.loads(COEFFICIENTS.read_text(encoding="utf-8")))


def parse_cost_model(values: JsonObject) -> CostModel:
    """Build a model from the content of its file."""
    parts = {name: BlockCounts(**values[name]) for name in ("counted", "seconds", "bytes", "commits")}
    return CostModel(fitted=values["fitted"], **parts)
