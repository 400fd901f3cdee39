"""What blocks took, laid to what there was of them: least squares that are not negative, for each stage apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from typing import Any

import numpy as np

from benchmarks.timing import figures
from tasks.city.block_counts import NO_COUNTS, BlockCounts
from tasks.city.cost import COUNT_NAMES, CostModel, load_cost_model, parse_cost_model

# What a stage's seconds are laid to; COURSE is what is beside units in this process, COMMAND what the command takes beside it.
COURSE, EXPORT, COMMAND = "course", "export", "command"
OF_SECONDS = {
    "exemplars": ("exemplars",),
    "facades": ("facades", "megatexels"),
    "viewpoints": ("viewpoints", "megapixels", "megatexels"),
    "surfaces": ("ground", "facades", "megatexels"),
    "pages": ("blocks", "megatexels"),
    "tiles": ("blocks", "facades", "megatexels"),
    "pictures": ("blocks", "facades", "megatexels"),
    COURSE: ("blocks", "facades", "viewpoints"),
    EXPORT: ("blocks", "facades", "megatexels"),
    COMMAND: ("blocks", "facades", "megatexels"),
}
OF_BYTES = {
    "store": ("blocks", "facades", "viewpoints", "megapixels", "megatexels"),
    "published": ("blocks", "facades", "megatexels"),
    "exports": ("blocks", "facades", "megatexels"),
}
# No block that the model is fitted on has enough of what these count; they keep their seconds: measured apart for pixels that
# are parsed, none for the rest, whose work is in facades and pixels.
KEPT_SECONDS = ("photos", "panoramas", "exemplar_megapixels", "photo_megapixels")
OF_COMMITS = {"commits": ("blocks", "facades", "viewpoints", "ground", "exemplars")}


@dataclass(frozen=True)
class Ran:
    """A block that was run: its name, texels a metre; what its map told, what it had; processor seconds by stage, where the
    command ran it all of them as COMMAND; bytes by folder; commits."""

    name: str
    density: float
    told: BlockCounts
    had: BlockCounts
    seconds: Mapping[str, float]
    bytes: Mapping[str, float]
    commits: Mapping[str, float] = field(default_factory=dict)

    def all_of(self, what: str) -> float:
        return sum(getattr(self, what).values())


def fit(
    blocks: Sequence[Ran],
    machine: str = "",
    error: Mapping[str, float] | None = None,
    error_planned: Mapping[str, float] | None = None,
) -> CostModel:
    """The model of some blocks, run on a machine of these words; error: by what it was off where it was checked, error_planned:
    likewise, with facades and texels by the plan."""
    whole = [block for block in blocks if block.commits]  # not those of which the command's part is known alone
    told, had = (sum((getattr(block, name) for block in whole), NO_COUNTS) for name in ("told", "had"))
    return parse_cost_model(
        {
            "fitted": {
                "on": datetime.now(UTC).strftime("%Y-%m-%d"),
                "machine": machine,
                "blocks": len(whole),
                "facades": int(had.facades),
                "texels_per_metre": sorted({block.density for block in whole}),
                "error": dict(error or {}),
                "error_planned": dict(error_planned or {}),
            },
            "counted": {
                name: figures(getattr(had, name) / getattr(told, name)) if getattr(told, name) else 1.0
                for name in COUNT_NAMES
            },
            "seconds": _laid(blocks, "seconds", OF_SECONDS)
            | {name: getattr(load_cost_model().seconds, name) for name in KEPT_SECONDS},
            "bytes": _laid(blocks, "bytes", OF_BYTES),
            "commits": _laid(blocks, "commits", OF_COMMITS),
        }
    )


def _laid(blocks: Sequence[Ran], what: str, of: Mapping[str, Sequence[str]]) -> dict[str, float]:
    """The parts laid to what there was, and added up, in shares of a block's whole: a part that is small in it counts little,
    and a block that is off by a tenth the same whatever its size."""
    from scipy.optimize import nnls

    total = dict.fromkeys(COUNT_NAMES, 0.0)
    for part, names in of.items():
        held = [block for block in blocks if part in getattr(block, what)]
        if not held:
            continue
        share = np.array([1 / block.all_of(what) for block in held])
        took = np.array([getattr(block, what)[part] for block in held])
        columns = np.array([[getattr(block.had, name) for name in names] for block in held])
        found, _ = nnls(columns * share[:, None], took * share)
        for name, one in zip(names, found.tolist(), strict=True):
            total[name] += one
    return {name: figures(one) for name, one in total.items()}


def of_it(cost: CostModel, block: Ran, *, planned: bool = False) -> dict[str, dict[str, float]]:
    """What the model says of a block by its map, beside what it had and took by the command; planned: with the facades and
    texels that its plan has."""
    said = block.told.multiply(cost.counted)
    if planned:
        said = replace(said, facades=block.had.facades, megatexels=block.had.megatexels)
    pairs = {
        name: (getattr(said, name), getattr(block.had, name))
        for name in ("facades", "viewpoints", "ground", "megatexels")
    }
    for what in ("seconds", "bytes", "commits"):
        pairs[what] = sum(asdict(said.multiply(getattr(cost, what))).values()), block.all_of(what)
    return {
        name: {"said": figures(one), "took": figures(took), "of_it": figures(one / took)}
        for name, (one, took) in pairs.items()
        if took
    }


def errors(found: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """By how much of what they took seconds, bytes and commits of some blocks are off at most."""
    return {
        what: figures(max(abs(one[what]["of_it"] - 1) for one in found), 2) for what in ("seconds", "bytes", "commits")
    }
