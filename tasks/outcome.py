"""What a task says of its units."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from facade_core.errors import FacadeError


@dataclass(frozen=True)
class Outcome:
    """done units, units skipped because the journal holds them, and the failed ones as (unit, reason)."""

    done: int = 0
    skipped: int = 0
    failed: tuple[tuple[str, str], ...] = ()

    @property
    def finished(self) -> int:
        return self.done + self.skipped + len(self.failed)

    def add(self, records: Iterable[dict[str, Any]]) -> Outcome:
        """With more units, by their journal records."""
        records = list(records)
        failed = tuple((r["unit"], r["reason"]) for r in records if r["status"] == "failed")
        return replace(self, done=self.done + len(records) - len(failed), failed=self.failed + failed)

    def __add__(self, other: Outcome) -> Outcome:
        return Outcome(self.done + other.done, self.skipped + other.skipped, self.failed + other.failed)


def is_done(record: dict[str, Any] | None, key: str) -> bool:
    """Whether the journal holds a unit for the inputs it has now; failed units are tried again."""
    return record is not None and record["key"] == key and record["status"] == "done"


def failure(unit: str, key: str, error: Exception) -> dict[str, Any]:
    """The journal record of a unit that failed as a whole; one line, whatever was raised."""
    reason = str(error) if isinstance(error, FacadeError) else f"{type(error).__name__}: {error}"
    return {
        "unit": unit,
        "key": key,
        "status": "failed",
        "reason": " ".join(reason.split()),
        "started": time.time(),
    }
