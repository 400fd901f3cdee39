"""A unit of work, as a value."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from facade_core.atlas.journal import Record

# Does units that go together, and writes what they make through a fork of the store's session: (run, fork, units) -> (fork,
# records by index).
UnitFunction = Callable[..., tuple[Any, dict[int, Record]]]


@dataclass(frozen=True)
class Unit:
    """One unit of work of a stage.

    index: its place in the stage's journal.
    name: what records and people call it.
    keys: what it stands on, one for each of its sources in the order in which they are tried; most units have one.
    arguments: what its function needs beside the run and its plan; the stage's own.
    memory: bytes that it takes of a worker at most, beside the libraries and the plan.
    charts: what it writes of the atlas: cleared where it fails, and of who seeds once it is due again.
    together: units with the same value here may share chunks, so one worker does them in one go; None alone.
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
        """What it stands on when every source but the last has failed; of most units the only key."""
        return self.keys[-1]


# What one worker does in one go.
UnitGroup = Sequence[Unit]
