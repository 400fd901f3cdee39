"""The parts of a plan that order the work of a run."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PlanSummary:
    """Summary of a plan for scheduling: streets, waves and rejected input, without arrays.

    Attributes
    ----------
    streets : name or id of each street.
    waves : indices of the streets of each wave.
    after : for each street, streets of earlier waves that share chunks with it; it waits for them.
    viewpoints : number of viewpoints of each street.
    windows : texels that each street reads, and those of them that it writes.
    set_aside : input that cannot be used, as (kind, unit, reason).
    ingested : when the plan was written, seconds since 1970.
    skipped : whether the store held the plan already.
    anew : why nothing of an earlier ingest was taken over, if so.
    """

    streets: tuple[str, ...]
    waves: tuple[tuple[int, ...], ...]
    after: tuple[tuple[int, ...], ...]
    viewpoints: tuple[int, ...]
    windows: tuple[tuple[int, int], ...]
    set_aside: tuple[tuple[str, str, str], ...]
    ingested: float
    skipped: bool
    anew: str | None = None
