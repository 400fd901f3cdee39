"""Units of work as values."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from icechunk import ForkSession

from facade_core.atlas.journal import Record
from tasks.engine.inputs import explain_difference, is_valid_key, join_key
from tasks.engine.run import Run

I_co = TypeVar("I_co", covariant=True)


@dataclass(frozen=True)
class Unit(Generic[I_co]):
    """One unit of work of a stage.

    Attributes
    ----------
    index : its index in the stage's journal.
    name : its name in records and messages.
    inputs : everything that its result depends on, besides the code.
    memory : bytes that it takes of a worker at most, besides libraries and the plan.
    charts : charts that it writes: cleared if it fails, and of the base layer once it is pending.
    group_id : units with the same value may share chunks, so one worker processes them in one go; None for a unit alone.
    is_corrected : whether somebody corrected its subject: its group is processed before others.
    digests : digest of the code and of each of its inputs.
    """

    index: int
    name: str
    inputs: I_co
    memory: int = 0
    charts: tuple[int, ...] = ()
    group_id: int | None = None
    is_corrected: bool = False
    digests: Mapping[str, str] = field(default_factory=dict)

    @property
    def key(self) -> str:
        """Return the key of a result that was computed from all inputs."""
        return join_key(self.digests)

    def is_done(self, record: Record | None) -> bool:
        """Return whether a record says that the unit is done from its present inputs."""
        return record is not None and record["status"] == "done" and is_valid_key(record["key"], self.digests)

    def explain_difference(self, record: Record) -> str | None:
        """Return which input differs from those of a record; None if none does."""
        if is_valid_key(record["key"], self.digests):
            return None
        return explain_difference(record["key"], self.inputs, self.digests)


# What one worker does in one go.
UnitGroup = Sequence[Unit[Any]]
# Processes a unit group, and writes its data through a fork of the store's session; returns the fork and the records by
# index.
UnitFunction = Callable[[Run, ForkSession, UnitGroup], tuple[ForkSession, dict[int, Record]]]
