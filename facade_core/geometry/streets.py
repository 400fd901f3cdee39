"""Viewpoints along street centrelines (street paper, 3) and the waves in which streets may run side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import LineString, Polygon

from facade_core.core.grouping import RowIndex

SHORTEST = 1.0  # m; a shorter street has no viewpoint


@dataclass(frozen=True)
class Viewpoint:
    """An upright panoramic camera: position (3,) metres, forward (2,) horizontal unit vector along the street."""

    id: int
    street: int
    position: np.ndarray
    forward: np.ndarray


def flat(points: np.ndarray) -> np.ndarray:
    """Ground at z = 0: heights (n,) of points (n, 2)."""
    return np.zeros(len(points))


def viewpoints(
    centreline: LineString,
    *,
    spacing: float = 5.0,
    height: float = 2.5,
    obstacles: Sequence[Polygon] | shapely.STRtree = (),
    clearance: float = 0.3,
    ground: Callable[[np.ndarray], np.ndarray] = flat,
) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n, 3) and forward directions (n, 2) every `spacing` metres along a centreline, `height` above the ground.

    The first stands half a spacing in, so that two streets that meet do not share a viewpoint; a street from SHORTEST to one
    spacing long has one in its middle. None stands inside an obstacle (a yard of it is outside) or nearer to one than
    `clearance` metres. A caller with many streets gives the obstacles as one tree. ground: heights (n,) of points (n, 2).
    """
    if centreline.length <= spacing:
        distance = np.array([centreline.length / 2] if centreline.length >= SHORTEST else [])
    else:
        distance = np.arange(spacing / 2, centreline.length, spacing)
    if len(distance) == 0:
        return np.empty((0, 3)), np.empty((0, 2))
    points = shapely.get_coordinates(shapely.line_interpolate_point(centreline, distance))
    step = min(0.5, spacing / 4)
    ahead = shapely.get_coordinates(
        shapely.line_interpolate_point(centreline, np.minimum(distance + step, centreline.length))
    )
    behind = shapely.get_coordinates(shapely.line_interpolate_point(centreline, np.maximum(distance - step, 0)))
    forward = ahead - behind
    length = np.linalg.norm(forward, axis=1)
    free = length > 1e-9
    tree = obstacles if isinstance(obstacles, shapely.STRtree) else shapely.STRtree(obstacles)
    free[tree.query(shapely.points(points), predicate="dwithin", distance=clearance)[0]] = False
    points, forward = points[free], forward[free] / length[free, None]
    return np.column_stack([points, ground(points) + height]), forward


def colour_waves(reads: Sequence[set], writes: Sequence[set]) -> np.ndarray:
    """Wave of each street, (n,) int32: streets of one wave never touch a chunk that the other writes.

    Greedy colouring of the conflict graph, streets with most conflicts first (ties: lower index), lowest free wave.
    """
    n = len(writes)
    readers: dict = {}
    for street, chunks in enumerate(reads):
        for chunk in chunks:
            readers.setdefault(chunk, set()).add(street)
    conflicts: list[set[int]] = [set() for _ in range(n)]
    for street, chunks in enumerate(writes):
        for chunk in chunks:
            for other in readers.get(chunk, ()):
                if other != street:
                    conflicts[street].add(other)
                    conflicts[other].add(street)
    wave = np.full(n, -1, np.int32)
    for street in sorted(range(n), key=lambda s: (-len(conflicts[s]), s)):
        taken = {int(wave[other]) for other in conflicts[street]}
        wave[street] = next(w for w in range(n + 1) if w not in taken)
    return wave


def predecessors(wave: np.ndarray, reads: np.ndarray, writes: np.ndarray) -> list[np.ndarray]:
    """For each street those of earlier waves that must have ended before it starts, as they touch a chunk that it writes, or
    write one that it reads: indices (k,), ascending.

    wave (n,); reads (r, 2) and writes (w, 2): pairs of a street and the number of a chunk, what is written among what is read.
    """
    writes, reads = (np.unique(pairs, axis=0) for pairs in (writes, reads))
    by_chunk = RowIndex(reads[:, 1])
    pairs = [np.zeros((0, 2), np.int64)]
    for street, chunk in writes.tolist():
        others = reads[by_chunk.rows_with(chunk), 0]
        pairs.append(np.column_stack([np.full(len(others), street), others]))
    both = np.concatenate(pairs)
    both = np.concatenate([both, both[:, ::-1]])
    both = np.unique(both[wave[both[:, 0]] < wave[both[:, 1]]], axis=0)
    after = RowIndex(both[:, 1])
    return [both[after.rows_with(street), 0] for street in range(len(wave))]
