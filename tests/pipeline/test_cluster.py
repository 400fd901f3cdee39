"""Whole runs on a scheduler and workers that were started as commands, in another folder."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from facade_core.core.errors import StoreError
from tasks.engine.store.commits import read_newest_journal
from tests.pipeline.runs import PATIENCE_S, ROOT, command, environment

pytestmark = pytest.mark.long


class Machines:
    """A scheduler and workers, each a command; all of them end with the block."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir()
        self.folder = folder
        self.processes: dict[str, subprocess.Popen] = {}
        told = folder / "scheduler.json"
        self._start(
            "scheduler",
            *("scheduler", "--host", "127.0.0.1", "--port", "0", "--dashboard-address", "127.0.0.1:0"),
            *("--scheduler-file", str(told)),
        )
        wait_until(lambda: told.is_file() and told.read_text().rstrip().endswith("}"))
        self.address = json.loads(told.read_text())["address"]

    def worker(self, name: str, threads: int = 1) -> None:
        self._start(
            name,
            *("worker", self.address, "--host", "127.0.0.1", "--no-nanny", "--nthreads", str(threads), "--name", name),
            *("--no-dashboard", "--memory-limit", "2GB", "--local-directory", str(self.folder)),
        )

    def joined(self, count: int) -> None:
        """Wait until so many workers are there: one that starts late may find that the others have done everything."""
        from distributed import Client

        with Client(self.address, timeout=PATIENCE_S) as client:
            client.wait_for_workers(count, timeout=PATIENCE_S)

    def kill(self, name: str) -> None:
        process = self.processes.pop(name)
        process.kill()
        process.wait()

    def _start(self, name: str, *arguments: str) -> None:
        with (self.folder / f"{name}.log").open("wb") as log:
            self.processes[name] = subprocess.Popen(
                [sys.executable, "-m", "dask", *arguments],
                cwd=self.folder,
                env=os.environ | {"PYTHONPATH": str(ROOT)},
                stdout=log,
                stderr=subprocess.STDOUT,
            )


@contextmanager
def machines(folder: Path) -> Iterator[Machines]:
    made = Machines(folder)
    try:
        yield made
    finally:
        for name in list(made.processes):
            made.kill(name)


def wait_until(true: Callable[[], object]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not true():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.05)


def done(out: Path, stage: str) -> int:
    """Units of a stage that the journal holds; -1 where there is no store yet."""
    try:
        return sum(record is not None for record in read_newest_journal(out / "store", stage))
    except (StoreError, KeyError, FileNotFoundError):
        return -1


def start(block: Path, out: Path, address: str) -> subprocess.Popen:
    return subprocess.Popen(
        [*command(block, out, 1), "--dask", address],
        cwd=ROOT,
        env=environment(out.parent),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def finish(process: subprocess.Popen, expect: int = 0) -> dict[str, Any]:
    said, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == expect, errors[-3000:]
    return json.loads(said.strip().splitlines()[-1])


def test_a_scheduler_that_goes_away_ends_the_run_in_one_line_and_the_next_goes_on(
    block: Path, undisturbed: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    """The block's path is relative, as typed; the workers stand elsewhere, and the second ones have two threads each."""
    out = tmp_path / "out"
    relative = Path(os.path.relpath(block, ROOT))
    with machines(tmp_path / "first") as first:
        for name in ("one", "two"):
            first.worker(name)
        process = start(relative, out, first.address)
        wait_until(lambda: done(out, "facades") >= 1)
        first.kill("scheduler")
        said, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 75
    assert said == ""
    assert "Traceback" not in errors
    assert "went away; run again to go on from here" in errors.strip().splitlines()[-1]  # after lines of progress
    held = done(out, "facades")
    assert held >= 1
    assert all(record["status"] == "done" for record in read_newest_journal(out / "store", "facades") if record)
    with machines(tmp_path / "second") as second:
        for name in ("three", "four"):
            second.worker(name, threads=2)
        second.joined(2)
        summary = finish(start(relative, out, second.address))
    assert summary["units_skipped"] > held
    assert summary["atlas_digest"] == undisturbed[1]["atlas_digest"]
    assert summary["facades_failed"] == 0
    workers = {
        record["worker"] for stage in ("facades", "surfaces") for record in read_newest_journal(out / "store", stage)
    }
    assert workers <= {"one", "two", "three", "four"}
    assert {"three", "four"} <= workers


def test_an_address_that_is_refused_ends_at_once_in_one_line(block: Path, tmp_path: Path) -> None:
    process = start(block, tmp_path / "out", "tcp://127.0.0.1:9")
    said, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 2
    assert said == ""
    assert len(errors.strip().splitlines()) == 1, errors
    assert "--dask tcp://127.0.0.1:9: no scheduler answers there" in errors
