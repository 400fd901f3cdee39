"""Workers killed, and others that join late: the same atlas, and nothing that was committed done again."""

from __future__ import annotations

import signal
import sys
import threading
import time
from collections import Counter
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cloudpickle
import pytest

from facade_core.atlas.store import BRANCH, open_repository
from tasks.engine import fan_out
from tasks.engine.compute.connect import connect
from tasks.engine.fan_out import process_batch
from tasks.engine.store.commits import read_newest_journal
from tasks.engine.unit import Unit, UnitGroup
from tests.pipeline.test_cluster import done, finish, machines, start, wait_until

pytestmark = pytest.mark.long

cloudpickle.register_pickle_by_value(sys.modules[__name__])


def slow(run: Any, fork: Any, units: UnitGroup) -> tuple[Any, dict[int, dict[str, Any]]]:
    """Leaves a line with its worker in a file of its own each time that it begins. Once the second worker is killed, the first
    does no more until the late one is at work: however long that takes to start, there is something left for it."""
    index, (folder,) = units[0].index, units[0].inputs
    from distributed import get_worker

    worker = str(get_worker().name)
    with (Path(folder) / str(index)).open("a") as file:
        file.write(f"{worker}\n")
    killed, late = (Path(folder).parent / name for name in ("killed", "late"))
    if worker == "late":
        late.touch()
    deadline = time.monotonic() + 300
    while worker == "one" and killed.exists() and not late.exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    time.sleep(0.2)
    return fork, {index: {"unit": str(index), "status": "done", "worker": worker}}


def test_a_killed_worker_repeats_what_it_had_and_a_late_one_is_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    committed: dict[int, str] = {}
    monkeypatch.setattr(fan_out, "fork_store", lambda store: ("session", "fork"))
    monkeypatch.setattr(
        fan_out,
        "commit_units",
        lambda session, fork, stage, records, message: committed.update(
            {index: record["worker"] for index, record in records.items()}
        ),
    )
    folder = tmp_path / "units"
    folder.mkdir()
    with machines(tmp_path / "machines") as cluster:
        cluster.worker("one")
        cluster.worker("two")
        with connect(1, cluster.address, str(tmp_path)) as compute:
            wait_until(lambda: compute.threads == 2)

            def lose() -> None:
                wait_until(lambda: len(committed) >= 5 and "two" in committed.values())
                before.extend(committed)
                (tmp_path / "killed").touch()
                cluster.kill("two")
                cluster.worker("late")

            before: list[int] = []
            thread = threading.Thread(target=lose)
            thread.start()
            work = [(Unit(i, str(i), (str(folder),), 10**6),) for i in range(40)]
            outcome = process_batch.fn(SimpleNamespace(store=None), "slow", "1", slow, work, compute)  # type: ignore[arg-type]
            thread.join()
    assert outcome.done == 40
    assert not outcome.failed
    runs = {int(path.name): path.read_text().split() for path in folder.iterdir()}
    assert sorted(runs) == list(range(40))
    assert all(len(runs[i]) == 1 for i in before)
    repeated = {i: workers for i, workers in runs.items() if len(workers) > 1}
    assert len(repeated) <= 3  # what ran there, what was next, and a result not fetched yet
    assert all(workers[0] == "two" and len(workers) == 2 for workers in repeated.values())
    assert "late" in committed.values()


def test_workers_killed_among_facades_and_among_surfaces(
    block: Path,
    undisturbed: tuple[Path, dict[str, Any]],
    tmp_path: Path,
) -> None:
    out = tmp_path / "out"
    with machines(tmp_path / "machines") as cluster:
        cluster.worker("one")
        cluster.worker("two")
        process = start(block, out, cluster.address)
        wait_until(lambda: done(out, "facades") >= 1)
        cluster.kill("one")
        cluster.processes["two"].send_signal(signal.SIGSTOP)  # or it may have done everything before the third is there
        cluster.worker("three")
        cluster.joined(2)
        cluster.processes["two"].send_signal(signal.SIGCONT)
        wait_until(lambda: done(out, "surfaces") >= 3)
        cluster.kill("two")
        summary = finish(process)
    assert summary["atlas_digest"] == undisturbed[1]["atlas_digest"]
    assert summary["facades_failed"] == 0
    assert summary["failures"] == []
    commits = Counter(s.message for s in open_repository(out / "store").ancestry(branch=BRANCH))
    assert {message: n for message, n in commits.items() if n > 1} == {}
    workers = {
        record["worker"] for stage in ("facades", "surfaces") for record in read_newest_journal(out / "store", stage)
    }
    assert "three" in workers
