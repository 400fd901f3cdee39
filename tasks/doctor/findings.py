"""What the doctor says."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """One line on a concern; well: False where something is to be done, which the line names; None for what is good to know."""

    concern: str
    is_well: bool | None
    message: str
