"""Completion problems made from whole layouts."""

from __future__ import annotations

import numpy as np
import pytest

from facade_core.core.types import Element
from training.layout import cases as training_cases

DOMAIN = (0.0, 0.0, 20.0, 20.0)
WINDOWS = [Element("window", x - 0.5, y - 0.7, x + 0.5, y + 0.7) for x in range(1, 20, 2) for y in range(2, 20, 3)]


@pytest.mark.parametrize("kind", [*training_cases.CASE_KINDS, *training_cases.OTHER_KINDS])
def test_every_kind_hides_a_part_and_no_hidden_element_meets_the_visible_region(kind: str) -> None:
    for seed in range(4):
        seen, region = training_cases.hide_part(kind, WINDOWS, DOMAIN, np.random.default_rng(seed))
        assert set(seen) < set(WINDOWS)
        for x0, y0, x1, y1 in region:
            assert 0 <= x0 < x1 <= 20 + 1e-9
            assert 0 <= y0 < y1 <= 20 + 1e-9
        for e in set(WINDOWS) - set(seen):
            assert not any(min(e.x1, r[2]) > max(e.x0, r[0]) and min(e.y1, r[3]) > max(e.y0, r[1]) for r in region)


def test_most_hides_seven_tenths() -> None:
    _, region = training_cases.hide_part("most", WINDOWS, DOMAIN, np.random.default_rng(0))
    visible = sum((x1 - x0) * (y1 - y0) for x0, y0, x1, y1 in region) / 400
    assert visible == pytest.approx(0.3, abs=0.06)
