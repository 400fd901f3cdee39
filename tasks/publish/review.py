"""Which facades somebody should look at first: those that are doubtful where streets see most of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from facade_core.plan.facades import Facades

# Facades above this change score count as changed. The largest score of an unchanged facade is 0.065
# (`python -m benchmarks.changes`).
MIN_CHANGE = 0.07


def review_priority(facades: Facades, index: int, record: Mapping[str, Any], quality: str | None) -> float:
    """How much a facade is worth a look, square metres: what its street sees of it, times how doubtful it is.

    That is how many things `quality` names, the share that was hidden, and how unsure the parser was of its elements, 0 to 1 on
    average. What somebody corrected is in no doubt.
    """
    if quality is None or record.get("corrected"):
        return 0.0
    elements = record.get("elements", ())
    unsure = 1 - float(np.mean([element[5] for element in elements])) if elements else 0.0
    flags = 0 if quality == "good" else 1 + quality.count(",")
    seen = float(facades.width[index] * facades.height[index] * facades.seen[index])
    return round(seen * (flags + (record.get("occluded") or 0.0) + unsure), 3)
