"""Cost model of a city: seconds, bytes and commits, fitted on runs by `benchmarks.city.cost`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from functools import cache
from pathlib import Path

import numpy as np

from facade_core.core.json_types import JsonObject
from tasks.city.block_counts import NO_COUNTS, BlockCounts, share_exemplars

COEFFICIENTS = Path(__file__).with_name("cost.json")
COUNT_NAMES = tuple(field.name for field in fields(BlockCounts))
BOTTLENECK_TEXTS = {
    "facades": "facades",
    "viewpoints": "viewpoints of streets",
    "ground": "ground",
    "megatexels": "texels (half the texels per metre is a quarter of the work)",
    "megapixels": "pixels in which viewpoints look for what they see (half texture.panorama_width is a quarter of the work)",
    "exemplars": "exemplars",
    "photos": "photos of facades",
    "panoramas": "panoramas with a pose",
    "exemplar_megapixels": "pixels of exemplars without a label map (half the width is a quarter of the work)",
    "photo_megapixels": "pixels of photos (half the width is a quarter of the work)",
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
        return spent.blocks + (self.processor_seconds(counts) - spent.blocks) / workers

    def correct_map_counts(self, counts_of_map: BlockCounts) -> BlockCounts:
        """Predict the actual counts of a block from those of its map."""
        return counts_of_map.multiply(self.counted)

    def processor_seconds(self, counts: BlockCounts) -> float:
        """Predict the processor seconds of blocks with these counts."""
        total: float = sum(asdict(counts.multiply(self.seconds)).values())
        return total

    def estimate(
        self, blocks: Sequence[BlockCounts], workers: int, at_once: int = 1, margin_s: float = 0.0
    ) -> JsonObject:
        """Predict hours with their interval, gigabytes, commits and the bottleneck of some blocks.

        Parameters
        ----------
        blocks : counts of each block of a city, or of one block; exemplars count once.
        workers : workers that the blocks share.
        at_once : blocks that run at the same time.
        margin_s : half width of the interval that the counts leave, in processor seconds.
        """
        blocks = share_exemplars(blocks)
        counts = sum(blocks, NO_COUNTS)
        spent = counts.multiply(self.seconds)
        shares = asdict(spent) | {name: getattr(spent, name) / workers for name in COUNT_NAMES if name != "blocks"}
        longest = max((self.clock_seconds(counts_of_block, workers) for counts_of_block in blocks), default=0.0)
        at_once = max(1, min(at_once, len(blocks)))
        # blocks share the workers of a city, unless each has a single one
        processes = workers if workers > 1 else at_once
        unit_seconds = self.processor_seconds(counts) - spent.blocks
        hours = max(spent.blocks / at_once + unit_seconds / processes, longest) / 3600
        most = max(shares, key=lambda name: shares[name])
        processor = self.processor_seconds(counts)
        margin = float(
            np.hypot(margin_s / max(processor, 1e-9), self.fitted.get("error_planned", {}).get("seconds", 0.0))
        )
        return {
            **{name: round(getattr(counts, name)) for name in COUNT_NAMES},
            "workers": processes,
            **_with_interval("hours", hours, margin),
            **_with_interval("processor_hours", processor / 3600, margin),
            "gigabytes": float(f"{sum(asdict(counts.multiply(self.bytes)).values()) / 1e9:.3g}"),
            "commits": round(sum(asdict(counts.multiply(self.commits)).values())),
            "bottleneck": BOTTLENECK_TEXTS[most],
            "bottleneck_share": round(shares[most] / max(sum(shares.values()), 1e-9), 2),
            "fitted": dict(self.fitted),
        }


def _with_interval(name: str, value: float, margin: float) -> dict[str, float]:
    """Return a value with the ends of its interval: a factor of 1 + margin to both sides."""
    ends = {name: value, f"{name}_low": value / (1 + margin), f"{name}_high": value * (1 + margin)}
    return {key: float(f"{one:.3g}") for key, one in ends.items()}


@cache
def load_cost_model() -> CostModel:
    """Load the newest fitted model."""
    return parse_cost_model(json.loads(COEFFICIENTS.read_text(encoding="utf-8")))


def parse_cost_model(values: JsonObject) -> CostModel:
    """Build a model from the content of its file."""
    parts = {name: BlockCounts(**values[name]) for name in ("counted", "seconds", "bytes", "commits")}
    return CostModel(fitted=values["fitted"], **parts)
