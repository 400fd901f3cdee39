"""Result type of the diagnosis."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """One line of the diagnosis.

    Attributes
    ----------
    concern : subject.
    is_well : False if action is needed, which the line names; None for information.
    message : text.
    """

    concern: str
    is_well: bool | None
    message: str
