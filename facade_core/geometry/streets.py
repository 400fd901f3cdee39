"""Viewpoints along street centrelines (street paper, 3), and waves of streets that may run in parallel."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import shapely
from shapely import LineString, Polygon

from facade_core.core.arrays import Float64Array, Int32Array, Int64Array
from facade_core.core.grouping import RowsByValue
from facade_core.geometry.settings import STREET_WAVES, StreetSettings

ChunkId = TypeVar("ChunkId", bound=Hashable)


@dataclass(frozen=True)
class Viewpoint:
    """Upright panoramic camera on a street.

    Attributes
    ----------
    id : index of the viewpoint.
    street : index of the street.
    position : (3,) metres.
    forward : (2,) horizontal unit vector along the street.
    """

    id: int
    street: int
    position: Float64Array
    forward: Float64Array


def zero_ground_heights(points: Float64Array) -> Float64Array:
    """Return zero ground heights (n,) for points (n, 2), as on level ground."""
    return np.zeros(len(points))


def place_viewpoints(
    centreline: LineString,
    *,
    spacing: float = 5.0,
    height: float = 2.5,
    obstacles: Sequence[Polygon] | shapely.STRtree = (),
    clearance: float = 0.3,
    ground: Callable[[Float64Array], Float64Array] = zero_ground_heights,
    settings: StreetSettings = STREET_WAVES,
) -> tuple[Float64Array, Float64Array]:
    """Place viewpoints every `spacing` metres along a centreline.

    The first is half a spacing from the start, so that two streets that meet share none. A street from `min_street_m` to
    one spacing long has one in its middle. Viewpoints inside obstacles are dropped; a courtyard is outside.

    Parameters
    ----------
    spacing : metres between viewpoints.
    height : metres above the ground.
    obstacles : polygons, or a tree of them for many streets.
    clearance : metres from a viewpoint to an obstacle.
    ground : maps points (n, 2) to ground heights (n,).
    settings : numbers of the step.

    Returns
    -------
    (n, 3) positions in metres, and (n, 2) forward unit vectors.
    """
    if centreline.length <= spacing:
        distance = np.array([centreline.length / 2] if centreline.length >= settings.min_street_m else [])
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


def assign_streets_to_waves(reads: Sequence[set[ChunkId]], writes: Sequence[set[ChunkId]]) -> Int32Array:
    """Assign streets to waves, (n,); within a wave no street touches a chunk that another writes.

    Greedy colouring of the conflict graph: streets with most conflicts first (ties: lower index), lowest free wave.
    """
    n = len(writes)
    readers: dict[ChunkId, set[int]] = {}
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


def street_predecessors(wave: Int32Array, reads: Int64Array, writes: Int64Array) -> list[Int64Array]:
    """Return for each street the streets of earlier waves that must end before it starts, ascending.

    They touch a chunk of its writes, or write a chunk of its reads.

    Parameters
    ----------
    wave : (n,) wave of each street.
    reads, writes : (r, 2) and (w, 2) pairs of street and chunk; writes are among the reads.
    """
    writes, reads = (np.unique(pairs, axis=0) for pairs in (writes, reads))
    by_chunk = RowsByValue(reads[:, 1])
    pairs = [np.zeros((0, 2), np.int64)]
    for street, chunk in writes.tolist():
        others = reads[by_chunk.rows_with(chunk), 0]
        pairs.append(np.column_stack([np.full(len(others), street), others]))
    both = np.concatenate(pairs)
    both = np.concatenate([both, both[:, ::-1]])
    both = np.unique(both[wave[both[:, 0]] < wave[both[:, 1]]], axis=0)
    after = RowsByValue(both[:, 1])
    return [both[after.rows_with(street), 0] for street in range(len(wave))]
