"""Medians over repeats: the machine may be shared, and the median forgives a neighbour's burst."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any


def seconds(action: Callable[[], Any], repeats: int) -> float:
    """Median wall time of `action` in seconds over `repeats` calls, after one call that imports and compiles."""
    action()
    return statistics.median(once(action) for _ in range(repeats))


def once(action: Callable[[], Any]) -> float:
    """Wall time of one call in seconds."""
    start = time.perf_counter()
    action()
    return time.perf_counter() - start


def figures(value: float, digits: int = 3) -> float:
    """`value` to so many significant figures: more would be noise."""
    return float(f"{value:.{digits}g}")


def bytes_in(folder: Path) -> int:
    """Bytes of all files in a folder."""
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
