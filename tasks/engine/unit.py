"""Units of work as values."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from icechunk import ForkSession

from facade_core.atlas.journal import Record
from tasks.engine.run import Run


@dataclass(frozen=True)
class Unit:
    """One unit of work of a stage.

    Attributes
    ----------
    index : its index in the stage's journal.
    name : its name in records and messages.
    keys : digests of its inputs, one for each source in the order in which they are tried; most units have one.
    arguments : further arguments of its function, defined by the stage.
    memory : bytes that it takes of a worker at most, besides libraries and the plan.
    charts : charts that it writes: cleared if it fails, and of the base layer once it is pending.
    group_id : units with the same value may share chunks, so one worker processes them in one go; None for a unit alone.
    """

    index: int
    name: str
    keys: tuple[str, ...]
    arguments: tuple[Any, ...] = ()
    memory: int = 0
    charts: tuple[int, ...] = ()
    group_id: int | None = None

    @property
    def key(self) -> str:
        """Return the key that holds when every source but the last failed; of most units the only key."""
        return self.keys[-1]


# What one worker does in one go.
UnitGroup = Sequence[Unit]
# Processes a unit group, and writes its data through a fork of the store's session; returns the fork and the records by
# index.
UnitFunction = Callable[[Run, ForkSession, UnitGroup], tuple[ForkSession, dict[int, Record]]]
