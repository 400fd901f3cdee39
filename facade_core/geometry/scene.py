"""A block as the street stage sees it: mesh, charts, their place in the atlas and a ray caster."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.name_hash import number_of
from facade_core.core.numba_cache import njit
from facade_core.core.types import Finish
from facade_core.geometry.chart_packing import Placement
from facade_core.geometry.charts import Charts, Mesh
from facade_core.geometry.daylight import Daylight
from facade_core.geometry.equirectangular import directions
from facade_core.geometry.raycast import MISS, RayCaster
from facade_core.geometry.streets import Viewpoint


@dataclass(frozen=True)
class Scene:
    """Geometry of a block. `spacing` (metres between viewpoints) and `visibility_range` (metres) gate the views of Eq. 1;
    names are the ids of the buildings, by row, finishes what is stated of their colours and materials; none is stated of any
    where there are none."""

    mesh: Mesh
    charts: Charts
    placement: Placement
    spec: AtlasSpec
    spacing: float = 5.0
    visibility_range: float = 40.0
    names: tuple[str, ...] = ()
    finishes: tuple[Finish, ...] = ()

    def __reduce__(self) -> tuple[type[Scene], tuple[Any, ...]]:
        """A scene goes to another process without what it derives, such as the tree of its rays."""
        return Scene, tuple(getattr(self, one.name) for one in fields(self))

    @cached_property
    def building_numbers(self) -> np.ndarray:
        """A number of 32 bits for each building, (buildings,) int64, that chance may be seeded by: of its id, so that it stays
        when others come and go; its row where the scene has no names."""
        if not self.names:
            return np.arange(max(1, int(self.charts.building.max(initial=0)) + 1))
        return np.array([number_of(name) for name in self.names])

    @cached_property
    def caster(self) -> RayCaster:
        return RayCaster(self.mesh)

    @cached_property
    def daylight(self) -> Daylight:
        return Daylight(self.charts, self.caster)

    def look(self, viewpoint: Viewpoint, width: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What a viewpoint sees: ray directions (h, w, 3), depth (h, w) metres and chart (h, w), MISS beyond the range too."""
        rays = directions(viewpoint.forward, width)
        depth, chart = self.caster.cast(viewpoint.position, rays)
        chart = np.where(depth <= self.visibility_range, chart, MISS)
        return rays, depth, chart

    def locate(self, points: np.ndarray, chart: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The texel that holds each world point (k, 3) on its chart (k,): row and column (k,) int32, clipped to the chart."""
        charts, placement = self.charts, self.placement
        row, column = np.empty(len(chart), np.int32), np.empty(len(chart), np.int32)
        frame = (charts.origin, charts.axis_u, charts.axis_v, placement.width, placement.height)
        _locate(points, chart, *frame, placement.texels_per_metre, row, column)
        return row, column

    def seen(self, viewpoint: Viewpoint, width: int) -> np.ndarray:
        """Sorted ids of the charts that the viewpoint's panorama shows: what it reads, and may write."""
        chart = self.look(viewpoint, width)[2]
        return np.unique(chart[chart != MISS])


@njit(cache=True, nogil=True)
def _locate(
    points: np.ndarray,
    chart: np.ndarray,
    origin: np.ndarray,
    axis_u: np.ndarray,
    axis_v: np.ndarray,
    width: np.ndarray,
    height: np.ndarray,
    density: np.ndarray,
    row: np.ndarray,
    column: np.ndarray,
) -> None:
    for k in range(len(chart)):
        c = chart[k]
        x, y = 0.0, 0.0
        for i in range(3):
            offset = points[k, i] - origin[c, i]
            x += offset * axis_u[c, i]
            y += offset * axis_v[c, i]
        column[k] = min(max(int(x * density[c]), 0), width[c] - 1)
        row[k] = min(max(int(y * density[c]), 0), height[c] - 1)
