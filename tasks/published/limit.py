"""How many failed units a block may have for what it publishes to become current."""

from __future__ import annotations

from facade_core.atlas.journal import read_journal
from facade_core.atlas.zarr_types import StoreGroup
from tasks.kinds.order import KINDS
from tasks.run import Run


def over_limit(run: Run, group: StoreGroup) -> str | None:
    """Why what a store holds is not to become current; None where so few units failed that it is.

    A street counts once, not by its viewpoints: one that fails leaves most of these undone, not failed.
    """
    records = [record for kind in KINDS if kind.part_of is None for record in read_journal(group, kind.stage)]
    failed = sum(record is not None and record["status"] == "failed" for record in records)
    if failed <= run.failed_limit * len(records):
        return None
    return (
        f"{failed} of {len(records)} units failed, more than the block's failed_limit of {run.failed_limit:.0%} allows: "
        "what is current stays as it was"
    )
