"""How many failed units a block may have for what it publishes to become current."""

from __future__ import annotations

from facade_core.atlas.journal import read_journal
from facade_core.core.zarr_types import StoreGroup
from tasks.engine.run import Run
from tasks.engine.stage import Stage
from tasks.stages.order import STAGES_IN_ORDER
from tasks.stages.pictures.stage import PICTURES
from tasks.stages.streets.stage import STREETS


def failure_limit_reason(run: Run, group: StoreGroup) -> str | None:
    """Why what a store holds is not to become current; None where so few units failed that it is.

    A street counts once, not by its viewpoints: one that fails leaves most of these undone, not failed. Stages that finish
    what others made count each by itself: there are so many surfaces that failed facades would not be seen among them.
    Pictures do not count: without some of them the report lacks an illustration, and nothing else is the worse.
    """
    last = STAGES_IN_ORDER.index(STREETS) + 1
    texturing = tuple(kind for kind in STAGES_IN_ORDER[:last] if kind.part_of is None)
    for kinds in (texturing, *((kind,) for kind in STAGES_IN_ORDER[last:] if kind is not PICTURES)):
        failed, total = _count_failed(group, kinds)
        if failed > run.failed_limit * total:
            units = "units" if len(kinds) > 1 else kinds[0].stage
            return (
                f"{failed} of {total} {units} failed, more than the block's failed_limit of {run.failed_limit:.0%} allows: "
                "what is current stays as it was"
            )
    return None


def _count_failed(group: StoreGroup, kinds: tuple[Stage, ...]) -> tuple[int, int]:
    """How many units of some kinds failed, and how many there are."""
    records = [record for kind in kinds for record in read_journal(group, kind.stage)]
    return sum(record is not None and record["status"] == "failed" for record in records), len(records)
