"""Summary of an ingest, for the run that continues from it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PlanSummary:
    """Summary of an ingest for the run.

    Attributes
    ----------
    set_aside : input that cannot be used, as (kind, unit, reason).
    ingested : when the plan was written, seconds since 1970.
    skipped : whether the store held the plan already.
    anew : why nothing of an earlier ingest was taken over, if so.
    """

    set_aside: tuple[tuple[str, str, str], ...]
    ingested: float
    skipped: bool
    anew: str | None = None
