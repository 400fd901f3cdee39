"""Reasons for which units are pending: the first of their inputs that changed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from facade_core.atlas.journal import Record
from tasks.engine.unit import Unit

# The journal has no record of the unit.
NEW = "new"
# The record has the unit's key, but says failed or stale.
NOT_DONE = "not done before"


def pending_reasons(records: Sequence[Record | None], units: Sequence[Unit[Any]]) -> dict[int, str]:
    """Return the reason of each unit that is not done, by index."""
    return {unit.index: _reason(records[unit.index], unit) for unit in units if not unit.is_done(records[unit.index])}


def _reason(record: Record | None, unit: Unit[Any]) -> str:
    return NEW if record is None else unit.explain_difference(record) or NOT_DONE
