"""0020: a reader while blocks are published over and over, in place and by snapshot."""

from __future__ import annotations

import os
import shutil
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

FILES = ("items.parquet", "models.parquet")
ROWS = 20_000


def measure(quick: bool, data: Path | None) -> dict[str, Any]:
    """What a reader of two files sees while they are published again: whole, mixed of two snapshots, or unreadable."""
    times = 5 if quick else 150
    return {
        "publications": times,
        "in_place": _watch(_write, lambda out: out, times),
        "file_by_file": _watch(_file_by_file, lambda out: out, times),
        "by_snapshot": _watch(_by_snapshot, _current, times),
    }


def _watch(publish: Callable[[Path, int], None], place: Callable[[Path], Path], times: int) -> dict[str, int]:
    seen: Counter[str] = Counter()
    over = threading.Event()

    def read(out: Path) -> None:
        while not over.is_set():
            seen[_read(place, out)] += 1

    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        publish(out, 0)
        reader = threading.Thread(target=read, args=(out,))
        reader.start()
        for snapshot in range(1, times + 1):
            publish(out, snapshot)
            time.sleep(0.002)
        over.set()
        reader.join()
    return {"reads": seen.total(), **{state: seen[state] for state in ("whole", "mixed", "unreadable")}}


def _read(place: Callable[[Path], Path], out: Path) -> str:
    try:
        folder = place(out)
        snapshots = {value for name in FILES for value in pq.read_table(folder / name)["snapshot"].unique().to_pylist()}
    except (OSError, pa.ArrowException):
        return "unreadable"
    return "whole" if len(snapshots) == 1 else "mixed"


def _write(folder: Path, snapshot: int) -> None:
    for name in FILES:
        pq.write_table(pa.table({"snapshot": pa.array([snapshot] * ROWS)}), folder / name)


def _file_by_file(out: Path, snapshot: int) -> None:
    """Each file is replaced in one step, but not both in the same one."""
    unfinished = out / "tmp"
    unfinished.mkdir(exist_ok=True)
    _write(unfinished, snapshot)
    for name in FILES:
        os.replace(unfinished / name, out / name)


def _by_snapshot(out: Path, snapshot: int) -> None:
    """A folder per snapshot, complete before the pointer names it: the order in which a run publishes."""
    unfinished = out / f".{snapshot}.tmp"
    unfinished.mkdir()
    _write(unfinished, snapshot)
    os.replace(unfinished, out / str(snapshot))
    pointer = out / ".current.tmp"
    pointer.write_text(str(snapshot))
    os.replace(pointer, out / "current")
    shutil.rmtree(out / str(snapshot - 20), ignore_errors=True)


def _current(out: Path) -> Path:
    return out / (out / "current").read_text()
