"""Review order of facades: doubtful ones that streets see most of come first."""

from __future__ import annotations

from catalogs.published.facade_values import fault_probability
from facade_core.plan.facades import Facades
from tasks.stages.facades.record import FacadeRecord

# Facades above this change score count as changed. The largest score of an unchanged facade is 0.065
# (`python -m benchmarks.changes`).
MIN_CHANGE = 0.07


def review_priority(facades: Facades, index: int, record: FacadeRecord | None, quality: str | None) -> float:
    """Compute the review priority of a facade, square metres: visible area times doubt.

    Doubt is the number of flags in `quality` and the probability that the texture is bad. A corrected facade has none.

    Parameters
    ----------
    facades : facades of the plan.
    index : index of the facade.
    record : journal record of the facade; None without one.
    quality : comma-separated quality flags, or "good"; None for a facade without a layout.
    """
    if quality is None or record is None or record.get("corrected"):
        return 0.0
    flags = 0 if quality == "good" else 1 + quality.count(",")
    seen = float(facades.width[index] * facades.height[index] * facades.seen[index])
    return round(seen * (flags + fault_probability(record)), 3)
