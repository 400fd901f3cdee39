"""Limit on failed units above which a snapshot does not become current."""

from __future__ import annotations

from facade_core.atlas.journal import read_journal
from facade_core.core.zarr_types import StoreGroup
from tasks.engine.run import Run
from tasks.engine.stage import Stage
from tasks.stages.order import EXEMPLARS, PICTURES, STAGES_IN_ORDER, STREETS


def failure_limit_reason(run: Run, group: StoreGroup) -> str | None:
    """Return why a store has too many failed units to become current; None if it has not.

    Stages that finish the output of others count separately: failed facades would not show among their many surfaces.
    Pictures do not count: a failed one only removes an illustration from the report. Nor do exemplars: walls take those
    that are left, and fail where none is.
    """
    last = STAGES_IN_ORDER.index(STREETS) + 1
    texturing = tuple(kind for kind in STAGES_IN_ORDER[:last] if kind is not EXEMPLARS)
    for kinds in (texturing, *((kind,) for kind in STAGES_IN_ORDER[last:] if kind is not PICTURES)):
        failed, total = _count_failed(group, kinds)
        limit = run.settings.failed_limit
        if failed > limit * total:
            units = "units" if len(kinds) > 1 else kinds[0].stage
            return (
                f"{failed} of {total} {units} failed, more than the block's failed_limit of {limit:.0%} allows: "
                "what is current stays as it was"
            )
    return None


def _count_failed(group: StoreGroup, kinds: tuple[Stage, ...]) -> tuple[int, int]:
    """Return the numbers of failed units and of all units of some stages."""
    records = [record for kind in kinds for record in read_journal(group, kind.stage)]
    return sum(record is not None and record["status"] == "failed" for record in records), len(records)
