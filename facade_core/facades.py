"""Which walls of a block are facades: those large enough that a street sees."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from facade_core.geometry.charts import WALL, Charts
from facade_core.geometry.streets import Viewpoint
from facade_core.street.scene import Scene
from facade_core.types import Building

# A wall is a facade when it is at least this large and this share of it is seen from some street.
FACADE_WIDTH_M = 3.0
FACADE_HEIGHT_M = 2.5
FACADE_SEEN = 0.25
# Nor is one that has fewer texels a side: there is nothing to parse in it.
FACADE_TEXELS = 16
# Points of a wall that are looked at, per axis.
SAMPLES = (5, 4)
# A storey is at least and at most this high: tagged levels can contradict the height.
STOREY_M = (2.2, 6.0)


@dataclass(frozen=True)
class Facades:
    """Facades as columns.

    id: a name that stays the same as long as the building's footprint does;
    chart, street, building (n,) int32 indices;
    width, height (n,) metres;
    floors (n,) int32, by the map, the ground floor included;
    seen (n,) the share of the wall that its street sees.
    """

    id: tuple[str, ...]
    chart: np.ndarray
    street: np.ndarray
    building: np.ndarray
    width: np.ndarray
    height: np.ndarray
    floors: np.ndarray
    seen: np.ndarray

    def __len__(self) -> int:
        return len(self.id)


def find_facades(
    scene: Scene,
    buildings: Sequence[Building],
    cameras: Sequence[Viewpoint],
    seen: Sequence[np.ndarray],
    storey: float,
) -> Facades:
    """Walls that a street sees; seen: the charts that each camera's panorama shows."""
    charts = scene.charts
    candidate = _large_walls(scene)
    best, street = _best_seen(scene, candidate, cameras, seen)
    chart = np.flatnonzero(candidate & (best >= FACADE_SEEN))
    building = charts.building[chart]
    wall = _wall_numbers(charts)[chart]
    width, height = charts.size[chart].T
    return Facades(
        id=tuple(f"{buildings[b].id}-{w}" for b, w in zip(building, wall, strict=True)),
        chart=chart.astype(np.int32),
        street=street[chart],
        building=building.astype(np.int32),
        width=width,
        height=height,
        floors=_floors([buildings[b].levels for b in building], height, storey),
        seen=best[chart],
    )


def _large_walls(scene: Scene) -> np.ndarray:
    """The walls that are large enough for a facade, (charts,) bool."""
    charts = scene.charts
    large = (charts.kind == WALL) & (charts.size[:, 0] >= FACADE_WIDTH_M) & (charts.size[:, 1] >= FACADE_HEIGHT_M)
    return large & (charts.texels(scene.spec.texels_per_metre).min(axis=1) >= FACADE_TEXELS)


def _best_seen(
    scene: Scene, candidate: np.ndarray, cameras: Sequence[Viewpoint], seen: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """The largest share of every chart that is seen from one street, (charts,), and the first such street, (charts,) int32, 0
    where none sees it: by looking from every viewpoint at a grid of points on each candidate in its panorama."""
    charts = scene.charts
    across, down = ((np.arange(n) + 0.5) / n for n in SAMPLES)
    grid = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    best, best_street = np.zeros(len(charts)), np.zeros(len(charts), np.int32)
    in_order = sorted(zip(cameras, seen, strict=True), key=lambda one: one[0].street)
    for street, looks in groupby(in_order, key=lambda one: one[0].street):
        visible: dict[int, np.ndarray] = {}
        for camera, row in looks:
            walls = row[candidate[row]]
            if len(walls) == 0:
                continue
            ray = charts.at_shares(walls, grid) - camera.position
            distance, chart = scene.caster.cast(camera.position, ray)
            reached = (distance > 1 - 1e-3) | (chart == walls[:, None])
            reached &= np.linalg.norm(ray, axis=-1) <= scene.visibility_range
            for wall, points in zip(walls.tolist(), reached, strict=True):
                visible[wall] = visible[wall] | points if wall in visible else points
        if not visible:
            continue
        shown, share = np.array(list(visible)), np.array(list(visible.values())).mean(axis=1)
        better = share > best[shown]
        best[shown[better]], best_street[shown[better]] = share[better], street
    return best, best_street


def _wall_numbers(charts: Charts) -> np.ndarray:
    """The number of each wall among those of its building, (charts,) int64."""
    number = np.zeros(len(charts), np.int64)
    walls = np.flatnonzero(charts.kind == WALL)
    walls = walls[np.argsort(charts.building[walls], kind="stable")]
    owners = charts.building[walls]
    number[walls] = np.arange(len(walls)) - np.searchsorted(owners, owners)
    return number


def _floors(levels: Sequence[int | None], height: np.ndarray, storey: float) -> np.ndarray:
    """Floors of facades (n,) int32: the tagged levels, else as many storeys as the height has; as many as it can have."""
    tagged = np.array([count or 0 for count in levels], np.int64)
    floors = np.where(tagged > 0, tagged, np.maximum(1, np.round(height / storey))).astype(np.int32)
    least, most = np.ceil(height / STOREY_M[1]), np.maximum(1, np.floor(height / STOREY_M[0]))
    return np.clip(floors, least, most).astype(np.int32)
