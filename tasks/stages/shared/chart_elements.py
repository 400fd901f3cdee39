"""Elements of finished facades by chart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from facade_core.core.types import Element
from facade_core.facade.stored_record import StoredFacadeRecord
from facade_core.plan.plan import Plan


def is_finished_facade(record: StoredFacadeRecord | None) -> bool:
    """Return True if a facade has a completed layout and texture."""
    return record is not None and "lattice" in record


def stored_elements(record: StoredFacadeRecord) -> list[Element]:
    """Return the elements of a completed facade, in texels, y down."""
    return [Element(*row) for row in record.get("elements", [])]


def elements_by_chart(plan: Plan, records: Sequence[StoredFacadeRecord | None]) -> dict[int, list[Element]]:
    """Return the elements of finished facades by chart, in metres, y down.

    Parameters
    ----------
    plan : plan of the block.
    records : journal record of each facade.
    """
    found = {}
    for chart, record in zip(plan.facades.chart.tolist(), records, strict=True):
        if record is not None and is_finished_facade(record):
            density = float(plan.scene.placement.texels_per_metre[chart])
            found[chart] = [
                replace(e, x0=e.x0 / density, y0=e.y0 / density, x1=e.x1 / density, y1=e.y1 / density)
                for e in stored_elements(record)
            ]
    return found
