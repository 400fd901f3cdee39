"""Medians over repeats: the machine may be shared, and the median forgives a neighbour's burst."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

Clock = Callable[[], float]


def seconds(action: Callable[[], Any], repeats: int, *, clock: Clock = time.perf_counter) -> float:
    """Median time of `action` in seconds over `repeats` calls, after one call that imports and compiles."""
    action()
    return statistics.median(once(action, clock=clock) for _ in range(repeats))


def once(action: Callable[[], Any], *, clock: Clock = time.perf_counter) -> float:
    """Seconds of one call: wall time, or processor time with `clock=time.process_time`, which neighbours hardly change."""
    start = clock()
    action()
    return clock() - start


def figures(value: float, digits: int = 3) -> float:
    """`value` to so many significant figures: more would be noise."""
    return float(f"{value:.{digits}g}")


def bytes_in(folder: Path) -> int:
    """Bytes of all files in a folder."""
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
