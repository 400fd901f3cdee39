"""What is worth a look first."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from facade_core.plan.facades import Facades
from tasks.publish.review import review_priority

FACADES = cast(
    Facades,
    SimpleNamespace(width=np.array([10.0, 20.0]), height=np.array([6.0, 6.0]), seen=np.array([0.5, 0.5])),
)


@pytest.mark.parametrize(
    ("index", "record", "quality", "metres"),
    [
        (0, {}, "good", 0.0),
        (0, {}, "assumed height", 30.0),
        (1, {}, "assumed height", 60.0),
        (0, {}, "assumed height, no source", 60.0),
        (0, {"foreign_share": 0.0, "doubtful_inpainting_m": 0.0}, "good", 3.422),
        (0, {"foreign_share": 1.0, "doubtful_inpainting_m": 0.0}, "foreign-parts", 60.0),
        (1, {"corrected": ["elements"], "foreign_share": 1.0}, "assumed height", 0.0),
        (1, {}, None, 0.0),
    ],
)
def test_doubt_counts_by_what_the_street_sees(
    index: int, record: dict[str, Any], quality: str | None, metres: float
) -> None:
    assert review_priority(FACADES, index, record, quality) == metres
