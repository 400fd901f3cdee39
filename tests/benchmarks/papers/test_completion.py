"""Methods that the layout paper compares: its search, simulated annealing (Fig. 14), and a matrix of low rank."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.papers.completion import annealing, low_rank, policy_search
from facade_core.core.types import Element
from facade_core.facade.layout.model import default_layout_model

DOMAIN = (0.0, 0.0, 200.0, 160.0)
LEFT = [(0.0, 0.0, 100.0, 160.0)]
SEEN = [Element("window", x - 8, y - 12, x + 8, y + 12) for y in (30, 70, 110) for x in (20, 60)]


def overlaps(elements: list[Element]) -> bool:
    boxes = [(e.x0, e.y0, e.x1, e.y1) for e in elements]
    return any(
        min(a[2], b[2]) > max(a[0], b[0]) and min(a[3], b[3]) > max(a[1], b[1])
        for i, a in enumerate(boxes)
        for b in boxes[:i]
    )


@pytest.mark.long
def test_searches_add_to_the_hidden_part_only() -> None:
    model = default_layout_model()
    for method in (policy_search(model, (2, 2)), annealing(model, 40)):
        (added,) = method(SEEN, DOMAIN, LEFT)
        assert all(e.x0 >= 0 and e.x1 <= 200 and e.y0 >= 0 and e.y1 <= 160 for e in added)
        assert all(e.x1 > 100 for e in added)
        assert not overlaps([e for e in (*SEEN, *added) if e.label == "window"])


@pytest.mark.long
def test_the_search_returns_its_best_candidate_again() -> None:
    method = policy_search(default_layout_model(), (2, 2))
    assert method(SEEN, DOMAIN, LEFT) == method(SEEN, DOMAIN, LEFT)


def test_a_matrix_of_rank_two_carries_a_row_on() -> None:
    """Floors of two patterns have rank two, and the hidden end of one floor follows from the others."""
    odd, even = (20, 60, 100, 140, 180), (40, 80, 120, 160)
    floors = {20: odd, 50: even, 80: odd, 110: even, 140: odd[:3]}
    seen = [Element("window", x - 10, y - 10, x + 10, y + 10) for y, columns in floors.items() for x in columns]
    region = [(0.0, 0.0, 200.0, 125.0), (0.0, 125.0, 126.0, 160.0)]
    (added,) = low_rank(seen, DOMAIN, region)
    found = np.array([(e.x0, e.y0, e.x1, e.y1) for e in added])
    np.testing.assert_allclose(found, [(130, 130, 150, 150), (170, 130, 190, 150)], atol=2)
