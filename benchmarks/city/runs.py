"""One run of the command in a process of its own, looked at as it runs: the memory of its processes, what its commits write."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil

from benchmarks.process_usage import process_role, user_environment

# Seconds between two looks.
LOOK_S = 1.0
# What a commit writes beside chunks, as folders of the store; each commit is a snapshot.
OF_COMMITS = ("manifests", "snapshots", "transactions")


@dataclass(frozen=True)
class Look:
    """The processes of a run at a time, seconds since 1970: megabytes of the coordinator, of each worker, and of all."""

    at: float
    coordinator: float
    workers: tuple[float, ...]
    total: float


@dataclass
class Ran:
    """A run: when the command was started and had ended, its summary, and what was seen meanwhile.

    history: bytes beside chunks and the commits that wrote them, when there were most of these.
    """

    begun: float
    ended: float
    summary: dict[str, Any]
    looks: list[Look] = field(default_factory=list)
    history: tuple[int, int] = (0, 0)

    @property
    def seconds(self) -> float:
        return self.ended - self.begun


def run(block: Path, out: Path, workers: int) -> Ran:
    """Run a block into `out` as a user would. Where the command fails the benchmark ends; failed units are in its summary."""
    command = [sys.executable, "-m", "flows", "run", str(block), "--out", str(out), "--workers", str(workers), "--json"]
    ran = Ran(time.time(), 0.0, {})
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=user_environment())
    watcher = threading.Thread(target=_watch, args=(process, out / "store", ran))
    watcher.start()
    output, _ = process.communicate()
    ran.ended = time.time()
    watcher.join()
    if process.returncode not in (0, 1):  # 1: units failed, the rest is done
        raise SystemExit(f"{block}: the run ended with {process.returncode}; its error is above")
    ran.summary = json.loads(output.strip().splitlines()[-1])
    return ran


def _watch(process: subprocess.Popen, store: Path, ran: Ran) -> None:
    while process.poll() is None:
        ran.looks.append(look_at(process.pid))
        ran.history = max(ran.history, _history(store), key=lambda one: one[1])
        time.sleep(LOOK_S)


def look_at(pid: int) -> Look:
    megabytes: dict[str, list[float]] = {"coordinator": [], "server": [], "workers": []}
    try:
        root = psutil.Process(pid)
        for one in (root, *root.children(recursive=True)):
            try:
                memory = one.memory_full_info()
                megabytes[process_role(one, root)].append(getattr(memory, "pss", memory.rss) / 1e6)
            except psutil.Error:
                continue
    except psutil.NoSuchProcess:
        pass
    workers = tuple(megabytes["workers"])
    return Look(time.time(), sum(megabytes["coordinator"]), workers, sum(map(sum, megabytes.values())))


def _history(store: Path) -> tuple[int, int]:
    """Bytes of what commits wrote beside chunks, and how many commits."""
    sizes: dict[str, list[int]] = {name: [] for name in OF_COMMITS}
    for name in OF_COMMITS:
        try:
            for entry in os.scandir(store / name):
                try:
                    sizes[name].append(entry.stat().st_size)
                except OSError:  # removed meanwhile, as history is expired
                    continue
        except OSError:  # not there yet
            continue
    return sum(map(sum, sizes.values())), len(sizes["snapshots"])
