"""Ambient daylight of untextured charts: the visible share of the sky, by rays, computed once per chart."""

from __future__ import annotations

from collections.abc import Sequence
from threading import Lock

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, Int64Array, IntArray
from facade_core.core.numba_cache import njit
from facade_core.geometry.charts import Charts
from facade_core.geometry.raycast import MISS, RayCaster
from facade_core.geometry.settings import DAYLIGHT

# Share of the light that is ambient.
MIN_DAYLIGHT = 0.35


class ChartDaylight:
    """Daylight of charts on their own grids, computed on demand and safe between threads.

    The light of a chart does not depend on the order of requests. Ground continues below buildings, where it takes the
    light of the ground around.

    Attributes
    ----------
    start : (charts,) first index of a chart's grid in `light`, -1 before it is computed.
    rows, columns : (charts,) shape of the grid, at least 2.
    light : (k,) MIN_DAYLIGHT to 1; its end may be unused.
    """

    def __init__(self, charts: Charts, caster: RayCaster) -> None:
        self._charts, self._caster = charts, caster
        places = np.maximum(np.ceil(charts.size / DAYLIGHT.place_spacing_m - 1e-6), 1).astype(np.int64) + 1
        self.columns, self.rows = places[:, 0].copy(), places[:, 1].copy()
        self.start = np.full(len(charts), -1, np.int64)
        self.light = np.zeros(0, np.float32)
        self._used = 0
        self._filling = Lock()

    def compute(self, wanted: Sequence[int] | IntArray) -> None:
        """Compute the missing light of the charts (k,)."""
        chosen = np.asarray(wanted, np.int64)
        if (self.start[chosen] >= 0).all():
            return
        with self._filling:
            self._fill(np.unique(chosen[self.start[chosen] < 0]))

    def _fill(self, new: Int64Array) -> None:
        count = self.rows[new] * self.columns[new]
        first = np.cumsum(count) - count
        own = np.repeat(new, count)
        row, column = np.divmod(np.arange(int(count.sum())) - np.repeat(first, count), self.columns[own])
        charts = self._charts
        share = np.column_stack([column / (self.columns[own] - 1), row / (self.rows[own] - 1)])
        inset = np.minimum(DAYLIGHT.ray_lift_m, 0.5 * charts.size[own])
        across, down = np.clip(share * charts.size[own] + DAYLIGHT.ray_shift_m, inset, charts.size[own] - inset).T
        normal = charts.normals()
        points = charts.points(own, across, down) + DAYLIGHT.ray_lift_m * normal[own]
        frame = np.stack([charts.axis_u[own], charts.axis_v[own], normal[own]], axis=1)
        clear, behind = np.zeros(len(own)), np.zeros(len(own))
        for direction in hemisphere_directions():
            ray = np.einsum("i,nij->nj", direction, frame)
            depth, met = self._caster.cast(points, ray)
            clear += np.minimum(depth, DAYLIGHT.max_occluder_m) / DAYLIGHT.max_occluder_m / DAYLIGHT.rays_per_place
            behind += (met != MISS) & (np.einsum("ij,ij->i", normal[met], ray) > 0)
        fill_daylight_inside_buildings(
            clear,
            behind > DAYLIGHT.max_back_face_share * DAYLIGHT.rays_per_place,
            first,
            self.rows[new],
            self.columns[new],
        )
        end = self._used + len(own)
        if end > len(self.light):  # doubled, so that adding charts one by one stays linear
            grown = np.ones(max(end, 2 * len(self.light)), np.float32)
            grown[: self._used] = self.light[: self._used]
            self.light = grown
        self.light[self._used : end] = MIN_DAYLIGHT + (1 - MIN_DAYLIGHT) * clear
        self.start[new] = self._used + first
        self._used = end


@njit(cache=True)
def fill_daylight_inside_buildings(
    clear: Float64Array, inside: BoolArray, first: Int64Array, rows: Int64Array, columns: Int64Array
) -> None:
    """Fill the sky shares of places inside buildings from visible neighbours, ring by ring, in place.

    Parameters
    ----------
    clear : (p,) share of visible sky of all places; changed.
    inside : (p,) places to fill.
    first : (k,) first place of each grid.
    rows, columns : (k,) shape of each grid.
    """
    for grid in range(len(first)):
        start, height, width = first[grid], rows[grid], columns[grid]
        hidden = inside[start : start + height * width].copy()
        left = 0
        for place in range(len(hidden)):
            left += hidden[place]
        if left == len(hidden):
            continue
        while left > 0:
            ring = hidden.copy()
            for row in range(height):
                for column in range(width):
                    if not hidden[row * width + column]:
                        continue
                    total, count = 0.0, 0
                    for r in range(max(row - 1, 0), min(row + 2, height)):
                        for c in range(max(column - 1, 0), min(column + 2, width)):
                            if not hidden[r * width + c]:
                                total, count = total + clear[start + r * width + c], count + 1
                    if count > 0:
                        clear[start + row * width + column] = total / count
                        ring[row * width + column] = False
                        left -= 1
            hidden = ring


def hemisphere_directions() -> Float64Array:
    """Return unit directions (`rays_per_place`, 3) about +z with cosine density: a spiral of equal steps."""
    share = (np.arange(DAYLIGHT.rays_per_place) + 0.5) / DAYLIGHT.rays_per_place
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(DAYLIGHT.rays_per_place)
    radius = np.sqrt(share)
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1 - share)])
