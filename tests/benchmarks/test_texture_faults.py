"""The rule of `quality` on textures is the one that its judged walls give."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.texture_faults import CHOSEN, fit, measure_photo, read_walls, report, write_parts
from catalogs.published.facade_values import FAULT_MEASURES, FAULT_OFFSET, fault_probability

PARTS = json.loads(CHOSEN.read_text(encoding="utf-8"))


def test_the_declared_rule_is_the_fitted_one() -> None:
    found = report(PARTS)
    assert found["offset"] == FAULT_OFFSET
    assert found["weights"] == {flag: measure.weight for flag, measure in FAULT_MEASURES.items()}
    assert found["usual"] == {flag: measure.usual for flag, measure in FAULT_MEASURES.items()}


def test_the_probability_is_that_of_the_fit() -> None:
    walls = read_walls(PARTS["held_out"])
    rule = fit(read_walls(PARTS["fitted"]))
    fields = [measure.field for measure in FAULT_MEASURES.values()]
    probabilities = [fault_probability(dict(zip(fields, row, strict=True))) for row in walls.measures.tolist()]
    odds = walls.measures @ rule.weights + rule.offset
    assert probabilities == pytest.approx(1 / (1 + np.exp(-odds)), abs=0.01)


def test_a_measure_that_decides_gets_the_weight() -> None:
    rng = np.random.default_rng(1)
    walls = read_walls(PARTS["fitted"])
    measures = rng.random(walls.measures.shape)
    told = walls._replace(measures=measures, verdict=np.where(measures[:, 1] > 0.6, 2, 0))
    weights = fit(told).weights
    assert weights[1] > 3 * abs(weights[0])


def test_the_file_is_written_as_it_is_read() -> None:
    assert write_parts(PARTS) == CHOSEN.read_text(encoding="utf-8")


def test_a_photo_has_the_measures_that_are_kept(data: Path) -> None:
    name, wall = next(iter(PARTS["held_out"]["ecp"].items()))
    assert measure_photo(data / name, is_rectified=True) == pytest.approx(wall[2:], abs=0.02)
