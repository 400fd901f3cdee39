"""The rule of `quality` on textures: `python -m benchmarks.texture_faults` fits it on walls judged by eye, and tests it.

texture_faults.json has each wall with its verdict (good, small flaws, bad), the reason, and the measures of its texture.
The measures were chosen on the walls of `fitted`, and the rule is fitted on them; photos of `held_out` were judged after both,
and scored once before two measures became their product. Photos of `as_taken` are those that halves 3 of street_photos use,
with the verdicts there (visible flaws are bad), judged and measured after all else.
`left_out`: each source of `fitted` by a rule that is fitted without it.
--data: measure the photos again. --runs: take the measures of walls from the records of runs of the example blocks.
"""

from __future__ import annotations

import argparse
import json
import math
import re
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
from scipy.optimize import minimize

from benchmarks.street_photos import TEXELS
from catalogs.published.facade_values import FAULT_MEASURES, MAX_GOOD_FAULT_PROBABILITY
from facade_core.core.provenance import Provenance
from facade_core.core.types import SHIPPED_MODELS
from facade_core.facade.photo_facade import NO_DOORS, complete_photo
from facade_core.facade.texture_faults import inpainted_radius
from facade_core.plan.plan import Plan
from tasks.engine.store.commits import read_newest_journal
from tasks.stages.facades.evidence import read_evidence
from tasks.stages.facades.imagery import FacadeImagery
from tasks.stages.facades.photos import crop_facade_photo

CHOSEN = Path(__file__).with_suffix(".json")
VERDICTS = ("good", "small flaws", "bad")
# Rectified sets; photos of others are as taken.
RECTIFIED = ("facades/artdeco/", "facades/ecp/", "facades/cmp/")
# Photos are taken at this density, for walls of 200 square metres.
TEXELS_PER_METRE = 20.0
# Weight of walls with small flaws, which may be flagged or not, and the penalty on squared standardised weights.
SMALL_FLAWS_WEIGHT, PENALTY = 0.5, 1.0


class Rule(NamedTuple):
    """Log odds of a bad texture: offset, and weights (n,) of the measures."""

    offset: float
    weights: np.ndarray

    def flags(self, measures: np.ndarray) -> np.ndarray:
        """Which walls (k,) the rule flags, by their measures (k, n)."""
        return measures @ self.weights + self.offset > math.log(
            MAX_GOOD_FAULT_PROBABILITY / (1 - MAX_GOOD_FAULT_PROBABILITY)
        )


class Walls(NamedTuple):
    """Judged walls: source (k,), verdict (k,) as a number of VERDICTS, measures (k, n)."""

    source: np.ndarray
    verdict: np.ndarray
    measures: np.ndarray

    def take(self, chosen: np.ndarray) -> Walls:
        """The walls that a mask (k,) chooses."""
        return Walls(*(part[chosen] for part in self))

    def rates(self, flagged: np.ndarray) -> dict[str, list[int]]:
        """Flagged walls and all, of each verdict."""
        return {
            name: [int(flagged[self.verdict == k].sum()), int((self.verdict == k).sum())]
            for k, name in enumerate(VERDICTS)
        }


def read_walls(part: dict[str, dict[str, list[Any]]]) -> Walls:
    """Read the walls of a part of texture_faults.json."""
    rows = [(source, VERDICTS.index(wall[0]), wall[2:]) for source, walls in part.items() for wall in walls.values()]
    source, verdict, measures = zip(*rows, strict=True)
    return Walls(np.array(source), np.array(verdict), np.array(measures, float))


def fit(walls: Walls) -> Rule:
    """Fit a logistic regression of bad walls against the others, with a penalty on standardised weights."""
    mean, spread = walls.measures.mean(axis=0), walls.measures.std(axis=0)
    standard = (walls.measures - mean) / spread
    is_bad, weight = walls.verdict == 2, np.where(walls.verdict == 1, SMALL_FLAWS_WEIGHT, 1.0)

    def loss(values: np.ndarray) -> float:
        odds = standard @ values[1:] + values[0]
        return float((weight * (np.logaddexp(0, odds) - is_bad * odds)).sum() + PENALTY * (values[1:] ** 2).sum())

    found = minimize(loss, np.zeros(1 + len(mean))).x
    weights = found[1:] / spread
    return Rule(float(found[0] - weights @ mean), weights)


def measure_photo(path: Path, *, is_rectified: bool) -> list[float]:
    """Measure the finished texture of a photo, in the order of FAULT_MEASURES."""
    height, width = crop_facade_photo(path, is_rectified).hidden.shape
    scale = math.sqrt(TEXELS / (height * width))
    size = (round(height * scale), round(width * scale))
    imagery = FacadeImagery(photo=path, rectified=is_rectified)
    evidence = read_evidence("photo", cast(Plan, None), 0, size, imagery, {}, [])
    assert evidence is not None
    made = complete_photo(evidence, NO_DOORS, models=SHIPPED_MODELS, seed=0)
    assert made.foreign_share is not None
    assert made.inpainting_doubt is not None
    radius = inpainted_radius(made.provenance == Provenance.INPAINTED) / TEXELS_PER_METRE
    return [round(made.foreign_share, 4), round(radius * made.inpainting_doubt, 4)]


def report(parts: dict[str, Any]) -> dict[str, object]:
    """Fit the rule on the fitted walls; returns it with the flagged walls of each part."""
    fitted = read_walls(parts["fitted"])
    rule, left_out = fit(fitted), np.zeros(len(fitted.source), bool)
    for source in np.unique(fitted.source):
        own = fitted.source == source
        left_out[own] = fit(fitted.take(~own)).flags(fitted.measures[own])
    usual = fitted.measures[fitted.verdict == 0].mean(axis=0)
    return {
        "offset": round(rule.offset, 2),
        "weights": dict(zip(FAULT_MEASURES, [float(f"{value:.3g}") for value in rule.weights], strict=True)),
        "usual": dict(zip(FAULT_MEASURES, [float(f"{value:.2g}") for value in usual], strict=True)),
        "fitted": fitted.rates(rule.flags(fitted.measures)),
        "left_out": fitted.rates(left_out),
        **{
            name: walls.rates(rule.flags(walls.measures))
            for name, walls in ((name, read_walls(parts[name])) for name in ("held_out", "as_taken"))
        },
    }


def write_parts(parts: dict[str, Any]) -> str:
    """Write the parts as JSON, a wall a line."""
    text = json.dumps(parts, indent=1)
    return re.sub(r"\[\s+([^\[\]]*?)\s+\]", lambda found: "[" + re.sub(r",\s*\n\s*", ", ", found[1]) + "]", text) + "\n"


def main(arguments: list[str] | None = None) -> None:
    """Fit the rule and print it with its tests as JSON."""
    parser = argparse.ArgumentParser(description="Fit and test the rule of `quality` on textures.")
    parser.add_argument("--data", type=Path, help="folder with facades/ and streetphotos/: measure the photos again")
    parser.add_argument("--runs", type=Path, nargs="+", default=[], help="results of the example blocks of Amsterdam")
    asked = parser.parse_args(arguments)
    parts = json.loads(CHOSEN.read_text(encoding="utf-8"))
    walls = {name: wall for part in parts.values() for source in part.values() for name, wall in source.items()}
    if asked.data is not None:
        for name, wall in walls.items():
            if "/" in name:
                wall[2:] = measure_photo(asked.data / name, is_rectified=name.startswith(RECTIFIED))
    for out in asked.runs:
        for record in read_newest_journal(out / "store", "facades"):
            if record is not None and record["unit"] in walls and "foreign_share" in record:
                walls[record["unit"]][2:] = [cast(Any, record)[measure.field] for measure in FAULT_MEASURES.values()]
    if asked.data is not None or asked.runs:
        CHOSEN.write_text(write_parts(parts), encoding="utf-8")
    print(json.dumps({"benchmark": "texture_faults"} | report(parts)))


if __name__ == "__main__":
    main()
