"""SIGKILL at random moments of runs that begin, go on, redo and publish: the same atlas and catalogue as undisturbed.

Who is killed is drawn too: the run, one of its workers, its Prefect server; for a part of the runs, the scheduler and the
workers of a cluster that is not the run's own. STREETLOOM_KILLS says how often; the suite is content with a few.
"""

from __future__ import annotations

import itertools
import json
import os
import random
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pandas as pd
import psutil
import pytest

from catalogs.query.execution import query
from facade_core.core.errors import FacadeError, StoreError
from tasks.engine.store.commits import read_newest_journal
from tasks.stages.order import STAGE_NAMES
from tasks.viewing.run_view import RunReader
from tests.pipeline import stages
from tests.pipeline.runs import PATIENCE_S, ROOT, command, environment, run
from tests.pipeline.test_cluster import machines

KILLS = int(os.environ.get("STREETLOOM_KILLS", "3"))
# Who is killed, as often as they are named.
VICTIMS = ("run", "run", "worker", "worker", "server", "publishing", "scheduler")
# Columns that say when something was done, how long that took, and where.
MOMENTS = ["updated", "seconds", "run"]
# What a run may end with once something of it was killed: done, the machine's fault, the cluster's loss.
ENDINGS = (0, 70, 75)

# Bounds a hang, and no more: a run takes a minute and a half where other work shares the cores.
pytestmark = [pytest.mark.long, pytest.mark.timeout(2400 + 300 * KILLS)]


def test_killed_at_random_moments(tmp_path: Path) -> None:
    draw = random.Random(20)
    stages.write_photo(tmp_path / "in", "a-0", 1)
    block = stages.write_block(tmp_path / "in")
    whole = run(block, tmp_path / "undisturbed" / "out", workers=1)
    length = whole["seconds"]
    out = tmp_path / "killed" / "out"
    out.parent.mkdir()
    killed: dict[str, int] = {}
    with read_all_the_while(out):
        _kill_again_and_again(block, out, length, draw, killed, tmp_path)
    last = run(block, out, workers=2)
    assert last["atlas_digest"] == whole["atlas_digest"]
    pd.testing.assert_frame_equal(catalogue(out), catalogue(tmp_path / "undisturbed" / "out"))
    assert left_over(out) == []
    print(f"killed {killed} in runs of {length:.0f} s")


def _kill_again_and_again(
    block: Path, out: Path, length: float, draw: random.Random, killed: dict[str, int], folder: Path
) -> None:
    redo: str | None = None
    # what goes on where a run was killed, or does one street again, is shorter than the whole
    for number in itertools.count():
        if sum(killed.values()) >= KILLS:
            return
        victim = draw.choice(VICTIMS)
        known = {} if redo else committed(out)
        with begun(block, out, folder / f"cluster-{number}", victim, redo) as process:
            hit = wait_and_kill(process, victim, out, draw.uniform(0.1, 0.7) * length)
            killed[victim] = killed.get(victim, 0) + hit
            said = process.communicate(timeout=PATIENCE_S)[1]
        assert process.returncode in (*ENDINGS, -9) or "no scheduler answers there" in said, said
        assert "Traceback" not in said, said
        assert_not_done_again(known, committed(out))
        redo = f"street {draw.choice(sorted(stages.STREETS))}" if process.returncode == 0 else None


@contextmanager
def read_all_the_while(out: Path) -> Iterator[None]:
    """Ask the catalogue and the viewer's reader again and again: once something is published, they always answer."""
    over, wrong = threading.Event(), []

    def look() -> None:
        while not over.wait(0.5):
            published = (out / "current").is_file()
            try:
                query(out)
                RunReader(out).open_newest().block_map()
            except Exception as error:
                if published or not isinstance(error, FacadeError):
                    wrong.append(repr(error))

    reader = threading.Thread(target=look)
    reader.start()
    try:
        yield
    finally:
        over.set()
        reader.join()
    assert wrong == []


@contextmanager
def begun(block: Path, out: Path, folder: Path, victim: str, redo: str | None) -> Iterator[subprocess.Popen]:
    """A run, on a cluster of its own or on one that is there; a street is done again where one is named."""
    words = command(block, out, 2)
    if redo and (out / "current").is_file():
        words += ["--redo", redo]
    if victim != "scheduler":
        with _running(words, out.parent) as process:
            yield process
        return
    with machines(folder) as cluster:
        cluster.worker("one")
        cluster.worker("two")
        with _running([*words, "--dask", cluster.address], out.parent) as process:
            process.scheduler = cluster.processes["scheduler"]  # type: ignore[attr-defined]
            yield process


@contextmanager
def _running(words: list[str], home: Path) -> Iterator[subprocess.Popen]:
    with subprocess.Popen(
        words, cwd=ROOT, env=environment(home), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            yield process
        finally:
            if process.poll() is None:
                process.kill()


def wait_and_kill(process: subprocess.Popen, victim: str, out: Path, seconds: float) -> bool:
    """Kill whom is named after so many seconds, or as soon as it is there after; whether it came to that."""
    begun, found = time.monotonic(), None
    while process.poll() is None and found is None:
        time.sleep(0.05)
        if victim == "publishing":
            found = psutil.Process(process.pid) if any(out.glob("published/.*.tmp")) else None
        elif time.monotonic() - begun > seconds:
            found = _found(process, victim)
    with suppress(psutil.NoSuchProcess):
        if found is not None:
            found.kill()
            return True
    return False


def _found(process: subprocess.Popen, victim: str) -> psutil.Process | None:
    with suppress(psutil.NoSuchProcess):
        if victim == "run":
            return psutil.Process(process.pid)
        if victim == "scheduler":
            return psutil.Process(process.scheduler.pid)  # type: ignore[attr-defined]
        word = {"worker": "spawn_main", "server": "prefect"}[victim]
        for child in psutil.Process(process.pid).children(recursive=True):
            line = child.cmdline()
            if any(word in part for part in line) and child.status() != psutil.STATUS_ZOMBIE:
                return child
    return None


def committed(out: Path) -> dict[tuple[str, str], tuple[str, float]]:
    """The key of every unit that is done, and when it was begun."""
    found = {}
    for stage in STAGE_NAMES:
        with suppress(StoreError, KeyError, FileNotFoundError):
            for record in read_newest_journal(out / "store", stage):
                if record and record["status"] == "done":
                    found[stage, record["unit"]] = (record["key"], record["started"])
    return found


def assert_not_done_again(before: dict[Any, tuple[str, float]], after: dict[Any, tuple[str, float]]) -> None:
    again = {unit for unit, (key, at) in before.items() if unit in after and after[unit] != (key, at)}
    assert not again


def catalogue(out: Path) -> pd.DataFrame:
    rows = pd.DataFrame(query(out)).drop(columns=MOMENTS, errors="ignore")
    return rows.sort_values(["kind", "id"]).reset_index(drop=True)


def left_over(out: Path) -> list[str]:
    """Files of work that was cut off, and processes that still hold the folder."""
    snapshot = (out / "current").read_text().strip()
    names = [path.name for pattern in ("published/.*", ".current*", ".seen*") for path in out.glob(pattern)]
    assert json.loads((out / "published" / snapshot / "summary.json").read_text())["atlas_digest"]
    deadline = time.monotonic() + PATIENCE_S
    while (running := _holding(out)) and time.monotonic() < deadline:
        time.sleep(0.2)
    return names + running


def _holding(out: Path) -> list[str]:
    found = []
    for process in psutil.process_iter():
        with suppress(psutil.NoSuchProcess, psutil.AccessDenied):
            line = " ".join(process.cmdline())
            if str(out) in line or process.environ().get("PREFECT_HOME", "").startswith(str(out)):
                found.append(line)
    return found
