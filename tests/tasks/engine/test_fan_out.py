"""Batches of units: their sizes, and what stays of their results."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cloudpickle
import psutil
import pytest
from hypothesis import given
from hypothesis import strategies as st

from facade_core.core.errors import FacadeError
from tasks.engine import fan_out
from tasks.engine.compute.cluster import ClusterGoneError
from tasks.engine.compute.connect import connect
from tasks.engine.compute.serial import SerialCompute
from tasks.engine.fan_out import BATCHES_AT_ONCE, MAX_BATCH_PIECES, make_batches, process_batch, unit_group_memory
from tasks.engine.outcome import error_reason
from tasks.engine.pending import PendingUnits
from tasks.engine.unit import Unit, UnitGroup
from tasks.stages.poses.stage import POSES

cloudpickle.register_pickle_by_value(sys.modules[__name__])

RESULT = 20_000_000


@dataclass(frozen=True)
class Room:
    memory: int
    threads: int


@st.composite
def pieces(draw: st.DrawFn) -> list[UnitGroup]:
    sizes = draw(st.lists(st.tuples(st.integers(1, 40), st.integers(0, 1000)), max_size=60))
    return [
        tuple(Unit(1000 * i + k, f"{i}/{k}", None, memory=memory) for k in range(n))
        for i, (n, memory) in enumerate(sizes)
    ]


@given(pieces(), st.integers(1, 3000), st.integers(1, 40))
def test_batches_keep_order_lose_nothing_and_fit(work: list[UnitGroup], memory: int, threads: int) -> None:
    made = list(make_batches(work, Room(memory, threads)))  # type: ignore[arg-type]
    assert [piece for batch in made for piece in batch] == work
    most = max(MAX_BATCH_PIECES, threads)
    for batch in made:
        assert batch
        if len(batch) > 1:
            assert BATCHES_AT_ONCE * sum(unit_group_memory(piece) for piece in batch) <= memory
            assert len(batch) <= most
    for batch, following in zip(made[:-1], made[1:], strict=True):  # and none is smaller than it need be
        joined = [*batch, following[0]]
        assert sum(unit_group_memory(piece) for piece in joined) > memory // BATCHES_AT_ONCE or len(joined) > most


def test_a_stage_counts_units_not_pieces() -> None:
    one, two, three = (Unit(i, str(i), None) for i in range(3))
    done: Any = ({},) * 4
    assert PendingUnits(POSES, ((one, two), (three,)), done).total == 7


@pytest.fixture
def commits(monkeypatch: pytest.MonkeyPatch) -> list[dict[int, dict[str, Any]]]:
    """The records of each commit, in order; no store."""
    made: list[dict[int, dict[str, Any]]] = []
    monkeypatch.setattr(fan_out, "fork_store", lambda store: ("session", "fork"))
    monkeypatch.setattr(fan_out, "commit_units", lambda session, fork, stage, records, message: made.append(records))
    return made


def big(run: Any, fork: Any, units: UnitGroup) -> tuple[bytes, dict[int, dict[str, Any]]]:
    index = units[0].index
    return os.urandom(RESULT), {index: {"unit": str(index), "status": "done"}}


def counted(run: Any, fork: Any, units: UnitGroup) -> tuple[Any, dict[int, dict[str, Any]]]:
    """Leaves a line in a file of its own each time that it runs."""
    index, (folder,) = units[0].index, units[0].inputs
    with (Path(folder) / str(index)).open("a") as file:
        file.write("run\n")
    if index == 3:
        raise ValueError("three\nis bad")
    return fork, {index: {"unit": str(index), "status": "done"}}


def batch(count: int, folder: Path) -> list[UnitGroup]:
    return [(Unit(i, str(i), (str(folder),), 10**6, digests={"code": str(i)}),) for i in range(count)]


RUN = SimpleNamespace(store=None)


@pytest.mark.long
def test_results_leave_the_cluster_one_by_one(
    tmp_path: Path, commits: list[dict[int, dict[str, Any]]], monkeypatch: pytest.MonkeyPatch
) -> None:
    own = psutil.Process()
    held: list[int] = []
    grown: list[int] = []
    with connect(2, None, str(tmp_path)) as compute:
        client = compute._client  # type: ignore[union-attr]

        def finish(session: Any, fork: bytes, stage: str, records: Any, message: str) -> None:
            assert len(fork) == RESULT
            commits.append(records)
            held.append(client.run_on_scheduler(lambda dask_scheduler: len(dask_scheduler.tasks)))
            grown.append(own.memory_info().rss)

        monkeypatch.setattr(fan_out, "commit_units", finish)
        outcome = process_batch.fn(RUN, "big", "1 of 1", big, batch(24, tmp_path), compute)
        assert outcome.done == 24
        assert held == sorted(held, reverse=True)
        assert held[-1] <= 2  # the one committed, and one whose release is on its way
        # A release is sent, not waited for; and how many results lie on a worker before the first is fetched is the machine's.
        assert _soon(lambda: client.run_on_scheduler(lambda dask_scheduler: len(dask_scheduler.tasks)) == 0)
        assert _soon(lambda: not any(client.run(lambda dask_worker: len(dask_worker.data)).values()))
    assert max(grown[2:]) - grown[1] < 5 * RESULT


def _soon(holds: Callable[[], bool]) -> bool:
    deadline = time.monotonic() + 120
    while not holds() and time.monotonic() < deadline:
        time.sleep(0.05)
    return holds()


def test_a_unit_runs_once_and_one_that_raises_is_recorded(tmp_path: Path, commits: list[dict[int, dict]]) -> None:
    outcome = process_batch.fn(RUN, "toys", "1 of 1", counted, batch(6, tmp_path), SerialCompute())
    assert outcome.done == 5
    ((unit, reason),) = outcome.failed
    assert (unit, reason) == ("3", error_reason(ValueError("three is bad")))
    assert [list(records) for records in commits] == [[i] for i in range(6)]
    expected = {"unit": "3", "key": "code:3", "status": "failed", "reason": reason}
    assert commits[3][3].items() >= expected.items()
    assert {path.read_text() for path in tmp_path.iterdir()} == {"run\n"}


def test_in_this_process_a_unit_is_committed_before_the_next_starts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A kill in the middle of a commit: what came before is committed, what comes after has not begun."""
    made: list[int] = []

    def finish(session: Any, fork: Any, stage: str, records: dict, message: str) -> None:
        if len(made) == 2:
            raise KeyboardInterrupt
        made.extend(records)

    monkeypatch.setattr(fan_out, "fork_store", lambda store: ("session", "fork"))
    monkeypatch.setattr(fan_out, "commit_units", finish)
    with pytest.raises(KeyboardInterrupt):
        process_batch.fn(RUN, "toys", "1 of 1", counted, batch(6, tmp_path), SerialCompute())
    assert made == [0, 1]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["0", "1", "2"]


class Gone(SerialCompute):
    def iterate_completed(self, started: Any) -> Any:
        yield from list(started)[:2]
        raise ClusterGoneError("away")


def test_a_cluster_that_goes_away_leaves_no_failed_records(
    tmp_path: Path, commits: list[dict[int, dict[str, Any]]]
) -> None:
    with pytest.raises(FacadeError):
        process_batch.fn(RUN, "toys", "1 of 1", counted, batch(6, tmp_path), Gone())
    assert [list(records) for records in commits] == [[0], [1]]
