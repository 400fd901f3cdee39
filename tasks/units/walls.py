"""What panoramas show of a building's walls that are no facades, and of its roofs, into the atlas."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import lru_cache
from typing import Any, cast

import numpy as np

from facade_core.atlas.journal import Record
from facade_core.atlas.store import open_root
from facade_core.cameras import before_buildings, beside_edges, photographed_wall
from facade_core.types import Pose
from tasks.outcome import refusal
from tasks.run import Run
from tasks.units.context import plan_of_run, worker_name
from tasks.units.shown.cameras import KEPT, cameras_of, write_shown
from tasks.units.unit import Piece


def wall_unit(run: Run, fork: Any, units: Piece) -> tuple[Any, dict[int, Record]]:
    """Write what panoramas show of one building's walls and roofs through the fork; returns the fork and the journal record."""
    start = time.time()
    (unit,) = units
    charts, taken = unit.arguments
    plan = plan_of_run(run)
    refused: list[Exception] = []
    cameras, used = cameras_of(taken, before_buildings, refused)
    cameras = [replace(one, hidden=one.hidden | _beside_edges(run, one.pose, one.hidden.shape)) for one in cameras]
    read = time.time()
    found = {chart: photographed_wall(plan.scene, chart, cameras) for chart in charts} if cameras else {}
    shown = {chart: one for chart, one in found.items() if one is not None}
    digests, told = write_shown(open_root(fork), plan, shown, used)
    record: Record = {
        "unit": unit.name,
        "key": unit.key,
        "status": "done",
        "digests": digests,
        "cameras": told,
        "worker": worker_name(),
        "started": start,
        "seconds": {"read": round(read - start, 4), "walls": round(time.time() - read, 4)},
    }
    record |= cast(Record, refusal(refused, "without it"))
    return fork, {unit.index: record}


def _beside_edges(run: Run, pose: Pose, shape: tuple[int, ...]) -> np.ndarray:
    """Of a panorama of so many pixels (H, W): bool."""
    rows, columns = shape
    bits = _edges_in_bits(run, pose, rows, columns)
    return np.unpackbits(bits, count=rows * columns).reshape(rows, columns).astype(bool)


@lru_cache(maxsize=KEPT)
def _edges_in_bits(run: Run, pose: Pose, rows: int, columns: int) -> np.ndarray:
    """Units side by side share them."""
    return np.packbits(beside_edges(plan_of_run(run).scene, pose, (rows, columns)))
