"""From units and spans to seconds lost, by cause."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.orchestration.trace import Span

# Whatever the coordinator is at while a worker waits, the first of these that applies; within no task it is Prefect.
COORDINATOR = {"commit": "commit", "session": "session", "orders": "orders", "task": "dispatch"}
CAUSES = ("plan", "state", "barrier", *COORDINATOR.values(), "prefect")
# Seconds of a unit that bring its input and put away its result.
IO = ("read", "write", "digest")


@dataclass(frozen=True)
class Unit:
    """One unit: where and when it ran (seconds since the epoch), how much of that was `prepare` and input or output.

    group: units of one group may run at the same time, streets that share nothing; the next group's wait for all of them.
    """

    group: str
    worker: str
    start: float
    end: float
    prepare: float = 0.0
    io: float = 0.0


def units_of(store: Path) -> list[Unit]:
    """Every unit of a store's journal that was done, in groups: its stage, streets for viewpoints too."""
    from tasks.store.commits import journal

    units = [_unit(stage, r) for stage in ("exemplars", "textures", "facades") for r in _done(journal(store, stage))]
    units += [_unit("streets", r) for stage in ("streets", "viewpoints") for r in _done(journal(store, stage))]
    return units


def _done(records: Iterable[Mapping[str, Any] | None]) -> list[Mapping[str, Any]]:
    return [record for record in records if record and record["status"] == "done"]


def _unit(group: str, record: Mapping[str, Any]) -> Unit:
    seconds = record["seconds"]
    return Unit(
        group,
        record["worker"],
        record["started"],
        record["started"] + sum(seconds.values()),
        seconds.get("prepare", 0.0),
        sum(seconds.get(stage, 0.0) for stage in IO),
    )


def groups(units: Sequence[Unit]) -> dict[str, tuple[float, float]]:
    """First start and last end of every group."""
    names = dict.fromkeys(unit.group for unit in units)
    return {
        name: (min(u.start for u in units if u.group == name), max(u.end for u in units if u.group == name))
        for name in names
    }


def window(units: Sequence[Unit], spans: Sequence[Span]) -> tuple[float, float]:
    """From the first unit's start to the end of the last unit or commit."""
    commits = [end for what, _, end in spans if what == "commit"]
    return min(u.start for u in units), max([u.end for u in units] + commits)


def lost(units: Sequence[Unit], spans: Sequence[Span], workers: int) -> dict[str, float]:
    """Worker seconds by cause (CAUSES) in which no unit was computed; their sum is all of them."""
    start, end = window(units, spans)
    held = groups(units)
    # between two neighbouring cuts nothing begins or ends
    cuts = np.unique([t for u in units for t in (u.start, u.end)] + [t for _, s, e in spans for t in (s, e)])
    cuts = np.unique(np.clip(cuts, start, end))
    middle, length = (cuts[1:] + cuts[:-1]) / 2, np.diff(cuts)
    doing = {cause: _covered(middle, [s[1:] for s in spans if s[0] == what]) for what, cause in COORDINATOR.items()}

    seconds = dict.fromkeys(CAUSES, 0.0)
    for unit in units:
        seconds["state" if unit.group == "streets" else "plan"] += unit.prepare
    names = sorted({u.worker for u in units})
    for worker in [*names, *[None] * (workers - len(names))]:  # one that had no unit at all counts too
        own = [u for u in units if u.worker == worker]
        idle = ~_covered(middle, [(u.start, u.end) for u in own])
        tails = [
            (max((u.end for u in own if u.group == name), default=first), last) for name, (first, last) in held.items()
        ]
        for cause, applies in {
            "barrier": _covered(middle, tails),
            **doing,
            "prefect": np.ones(len(middle), bool),
        }.items():
            seconds[cause] += float(length[idle & applies].sum())
            idle &= ~applies
    return seconds


def _covered(times: np.ndarray, intervals: Sequence[tuple[float, float]]) -> np.ndarray:
    """Which of the sorted times (n,) lie in any of the intervals."""
    opened = np.zeros(len(times) + 1, np.int64)
    for start, end in intervals:
        opened[np.searchsorted(times, start)] += 1
        opened[np.searchsorted(times, max(start, end))] -= 1
    return np.cumsum(opened)[:-1] > 0
