"""0002: what is left of two arrays when the process that rewrites them is killed."""

from __future__ import annotations

import random
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import zarr

from benchmarks.timing import figures
from facade_core.atlas.store import commit, open_repository

CHUNK = 128
ARRAYS = ("colour", "provenance")


def measure(quick: bool, data: Path | None) -> dict[str, Any]:
    """Writers killed by SIGKILL at random moments; a state is torn when it mixes chunks of two generations."""
    kills, chunks = (2, 4) if quick else (30, 64)
    rng = random.Random(0)
    result: dict[str, Any] = {"kills": kills, "chunks_per_array": chunks}
    for kind in ("plain_zarr", "icechunk"):
        states: Counter[str] = Counter()
        written = []
        for _ in range(kills):
            with tempfile.TemporaryDirectory() as folder:
                written.append(_kill_a_writer(kind, Path(folder) / "store", chunks, rng))
                states[_state(kind, Path(folder) / "store")] += 1
        result[kind] = {state: states[state] for state in ("whole", "torn", "unreadable")} | {
            "seconds_per_generation": figures(float(np.median(written)))
        }
    return result


def _kill_a_writer(kind: str, store: Path, chunks: int, rng: random.Random) -> float:
    """Let a process rewrite the arrays over and over, and kill it within the next three generations; seconds of the second."""
    command = [sys.executable, "-m", "benchmarks.decisions.killed", kind, str(store), str(chunks)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        seconds = float(process.stdout.readline())
        time.sleep(seconds * rng.uniform(0, 3))
        process.kill()
    return seconds


def _state(kind: str, store: Path) -> str:
    try:
        group = _open(kind, store)
        values = np.unique(np.concatenate([np.unique(group[name][:]) for name in ARRAYS]))
    except Exception:  # whatever the libraries raise for half a file
        return "unreadable"
    return "whole" if len(values) == 1 else "torn"


def _open(kind: str, store: Path) -> Any:
    if kind == "plain_zarr":
        return zarr.open_group(store, mode="r")
    return zarr.open_group(open_repository(store).readonly_session("main").store, mode="r")


def write_until_killed(kind: str, store: Path, chunks: int) -> None:
    """Rewrite both arrays with the number of the generation, for ever; prints the seconds of the second one."""
    repository = open_repository(store, create=True) if kind == "icechunk" else None
    generation = 0
    while True:
        start = time.perf_counter()
        session = repository.writable_session("main") if repository else None
        group: Any = zarr.open_group(session.store if session else store, mode="a")
        for name in ARRAYS:
            if generation == 0:
                group.create_array(name, shape=(chunks * CHUNK, CHUNK), chunks=(CHUNK, CHUNK), dtype="uint8")
            group[name][:] = generation % 256
        if session:
            commit(session, f"generation {generation}")
        if generation == 1:
            print(time.perf_counter() - start, flush=True)
        generation += 1


if __name__ == "__main__":
    write_until_killed(sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]))
