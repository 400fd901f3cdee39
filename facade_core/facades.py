"""Which walls of a block are facades: those large enough that a street sees."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from facade_core.geometry.charts import WALL
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


@dataclass(frozen=True)
class Facades:
    """Facades as columns: chart, street, building (n,) int32 indices; width, height (n,) metres; floors (n,) int32; seen (n,)
    the share of the wall that its street sees; id, a name that stays the same as long as the building's footprint does."""

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
    streets: int,
    storey: float,
) -> Facades:
    """Walls that a street sees, by looking from every viewpoint at a grid of points on each wall in its panorama."""
    charts = scene.charts
    candidate = (charts.kind == WALL) & (charts.size[:, 0] >= FACADE_WIDTH_M) & (charts.size[:, 1] >= FACADE_HEIGHT_M)
    candidate &= charts.texels(scene.spec.texels_per_metre).min(axis=1) >= FACADE_TEXELS
    at = np.stack(
        np.meshgrid((np.arange(SAMPLES[0]) + 0.5) / SAMPLES[0], (np.arange(SAMPLES[1]) + 0.5) / SAMPLES[1]), axis=-1
    ).reshape(-1, 2)
    visible = np.zeros((streets, len(charts), len(at)), bool)
    for camera, row in zip(cameras, seen, strict=True):
        walls = row[candidate[row]]
        if len(walls) == 0:
            continue
        xy = at[None] * charts.size[walls][:, None]
        points = (
            charts.origin[walls][:, None]
            + xy[..., :1] * charts.axis_u[walls][:, None]
            + xy[..., 1:] * charts.axis_v[walls][:, None]
        )
        ray = points - camera.position
        distance, chart = scene.caster.cast(camera.position, ray)
        reached = (distance > 1 - 1e-3) | (chart == walls[:, None])
        visible[camera.street, walls] |= reached & (np.linalg.norm(ray, axis=-1) <= scene.visibility_range)
    share = visible.mean(axis=2) if streets else np.zeros((1, len(charts)))
    owner = share.argmax(axis=0)
    best = share.max(axis=0)
    chart = np.flatnonzero(candidate & (best >= FACADE_SEEN))
    building = charts.building[chart]
    wall_number = np.zeros(len(charts), np.int64)
    walls = np.flatnonzero(charts.kind == WALL)
    walls = walls[np.argsort(charts.building[walls], kind="stable")]
    owners = charts.building[walls]
    wall_number[walls] = np.arange(len(walls)) - np.searchsorted(owners, owners)
    width, height = charts.size[chart].T
    levels = np.array([buildings[b].levels or 0 for b in building], np.int64)
    floors = np.where(levels > 0, levels, np.maximum(1, np.round(height / storey))).astype(np.int32)
    # Tagged levels can contradict the height; a storey below 2.2 m or above 6 m is one that nobody built.
    floors = np.clip(floors, np.ceil(height / 6.0), np.maximum(1, np.floor(height / 2.2))).astype(np.int32)
    return Facades(
        id=tuple(f"{buildings[b].id}-{wall_number[c]}" for b, c in zip(building, chart, strict=True)),
        chart=chart.astype(np.int32),
        street=owner[chart].astype(np.int32),
        building=building.astype(np.int32),
        width=width,
        height=height,
        floors=floors,
        seen=best[chart],
    )
