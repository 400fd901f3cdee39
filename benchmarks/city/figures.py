"""From what a run left to figures."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.city.runs import Ran
from benchmarks.timing import bytes_in, figures
from facade_core.atlas.store import BRANCH, open_repository, open_root
from tasks.engine.store.commits import read_newest_journal
from tasks.stages.order import STAGES_IN_ORDER

# Fewer workers than this share of them with a unit: not busy.
BUSY = 0.9

Interval = tuple[float, float]


def figures_of(ran: Ran, out: Path, workers: int) -> dict[str, Any]:
    """What a run took, by stage and phase; what it left, in bytes."""
    records = {
        kind.stage: [r for r in read_newest_journal(out / "store", kind.stage) if r and "seconds" in r]
        for kind in STAGES_IN_ORDER
    }
    units = {stage: [_interval(record) for record in of] for stage, of in records.items() if of}
    by_worker: dict[str, list[Interval]] = {}
    for of in records.values():
        for record in of:
            by_worker.setdefault(record["worker"], []).append(_interval(record))
    for log in (out / "logs").iterdir():
        for said in map(json.loads, log.read_text("utf-8").splitlines()):
            if said.get("stage") == "ingest" and "worker" in said:  # rays are cast there before any unit
                by_worker.setdefault(said["worker"], []).append(_interval(said))
    session = open_repository(out / "store").readonly_session(BRANCH)
    ingested = float(open_root(session).attrs["ingested"])
    published = out / "published" / (out / "current").read_text().strip()
    first, last = (choose([t for of in units.values() for one in of for t in one]) for choose in (min, max))
    current = (out / "current").stat().st_mtime
    cuts = [ran.begun, ingested, first, last, current, ran.ended]
    facades = ran.summary["facades_done"]
    published_mb = bytes_in(published) / 1e6
    written, commits = ran.history
    return {
        "facades": facades,
        "viewpoints": ran.summary["viewpoints"],
        "failures": ran.summary["failures"],
        "seconds": figures(ran.seconds),
        "seconds_by_facade": figures(ran.seconds / facades),
        "phases_s": dict(
            zip(
                ("ingested", "first_unit", "units", "published", "ended"),
                map(figures, np.diff(cuts).tolist()),
                strict=True,
            )
        ),
        "stages": {stage: _stage(of) for stage, of in units.items()},
        "publish_s_by_mb": figures((current - last) / published_mb),
        "ingest_s_by_facade": figures((ingested - ran.begun) / facades),
        "not_busy": not_busy(by_worker, workers, [ran.begun, first, last, ran.ended]),
        "memory_mb": {
            "coordinator": round(max(look.coordinator for look in ran.looks)),
            "worker": round(max(max(look.workers, default=0.0) for look in ran.looks)),
            "all": round(max(look.total for look in ran.looks)),
        },
        "store_mb": figures(bytes_in(out / "store") / 1e6),
        "store_mb_by_facade": figures(bytes_in(out / "store") / 1e6 / facades),
        "published_mb": figures(published_mb),
        "published_mb_by_facade": figures(published_mb / facades),
        "commits": commits,
        "commit_kb": figures(written / max(commits, 1) / 1e3),
        "atlas_digest": ran.summary["atlas_digest"],
    }


def _interval(record: Mapping[str, Any]) -> Interval:
    return record["started"], record["started"] + sum(record["seconds"].values())


def _stage(units: Sequence[Interval]) -> dict[str, float]:
    wall = max(end for _, end in units) - min(start for start, _ in units)
    return {
        "units": len(units),
        "unit_s": figures(sum(end - start for start, end in units) / len(units)),
        "wall_s": figures(wall),
        "wall_s_by_unit": figures(wall / len(units)),
    }


def not_busy(units: Mapping[str, Sequence[Interval]], workers: int, cuts: Sequence[float]) -> dict[str, float]:
    """Shares of a command in which fewer than BUSY of the workers had a unit: in all, and before, among and after units.

    units: those of each worker; cuts: when the command began, the first unit began, the last ended, and the command ended.
    """
    ends = sorted({*cuts, *(t for of in units.values() for one in of for t in one)})
    times = np.array([t for t in ends if cuts[0] <= t <= cuts[-1]])
    middle, length = (times[1:] + times[:-1]) / 2, np.diff(times)
    busy = np.zeros(len(middle), np.int64)
    for of in units.values():
        held = np.zeros(len(middle), bool)
        for start, end in of:
            held |= (middle > start) & (middle < end)
        busy += held
    idle = busy < BUSY * workers
    parts = {
        name: float(length[idle & (middle > start) & (middle < end)].sum()) / (cuts[-1] - cuts[0])
        for name, start, end in zip(("before", "among", "after"), cuts, cuts[1:], strict=False)
    }
    return {"all": figures(sum(parts.values())), **{name: figures(share) for name, share in parts.items()}}


def ratios(first: Mapping[str, Any], last: Mapping[str, Any]) -> dict[str, Any]:
    """Every figure of one block over that of another, where both have it."""
    found: dict[str, Any] = {}
    for name in first.keys() & last.keys():
        one, other = first[name], last[name]
        if isinstance(one, Mapping):
            found[name] = ratios(one, other)
        elif isinstance(one, int | float) and one:
            found[name] = figures(other / one)
    return {name: found[name] for name in first if name in found}


def begun(out: Path) -> dict[tuple[str, str], float]:
    """When each unit was begun, by stage and name."""
    records = ((kind.stage, r) for kind in STAGES_IN_ORDER for r in read_newest_journal(out / "store", kind.stage) if r)
    return {(stage, record["unit"]): record.get("started", 0.0) for stage, record in records}
