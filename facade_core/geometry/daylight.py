"""Soft light on what has no texture yet: how much of the sky each place of a chart sees, by rays, once per chart."""

from __future__ import annotations

from collections.abc import Sequence
from threading import Lock

import numpy as np

from facade_core.core.numba_cache import njit
from facade_core.geometry.charts import Charts
from facade_core.geometry.raycast import MISS, RayCaster

# Metres between the places of a chart that are looked from, its border's among them; light is linear between them.
CELL_M = 2.0
RAYS = 24
# What stands farther than this takes no light.
REACH_M = 20.0
# Rays start this far off the surface and within its border: a vertex may lie centimetres off its chart's plane. So far aside
# they start too, as walls often stand on whole metres.
LIFT_M, ASIDE_M = 0.05, 0.013
# Of the light, this much comes from everywhere.
LEAST = 0.35
# A place from which more than this share of rays meets surfaces from behind is inside of something.
INSIDE = 0.5


class Daylight:
    """Light of charts on grids of their own, filled in as charts come into view.

    place (charts,) int64 where a chart's grid starts in `light`, -1 before it is computed; rows, columns (charts,) int64 its
    shape, at least 2; light (k,) float32 in LEAST..1, of which the last may not be in use. The same for a chart whatever else
    was asked for before it, by whichever thread. Ground goes on below houses: there it has the light of the ground beside.
    """

    def __init__(self, charts: Charts, caster: RayCaster) -> None:
        self._charts, self._caster = charts, caster
        places = np.maximum(np.ceil(charts.size / CELL_M - 1e-6), 1).astype(np.int64) + 1
        self.columns, self.rows = places[:, 0].copy(), places[:, 1].copy()
        self.place = np.full(len(charts), -1, np.int64)
        self.light = np.zeros(0, np.float32)
        self._used = 0
        self._filling = Lock()

    def reach(self, wanted: Sequence[int] | np.ndarray) -> None:
        """Compute what is missing of some charts."""
        chosen = np.asarray(wanted, np.int64)
        if (self.place[chosen] >= 0).all():
            return
        with self._filling:
            self._fill(np.unique(chosen[self.place[chosen] < 0]))

    def _fill(self, new: np.ndarray) -> None:
        count = self.rows[new] * self.columns[new]
        first = np.cumsum(count) - count
        own = np.repeat(new, count)
        row, column = np.divmod(np.arange(int(count.sum())) - np.repeat(first, count), self.columns[own])
        charts = self._charts
        share = np.column_stack([column / (self.columns[own] - 1), row / (self.rows[own] - 1)])
        inset = np.minimum(LIFT_M, 0.5 * charts.size[own])
        across, down = np.clip(share * charts.size[own] + ASIDE_M, inset, charts.size[own] - inset).T
        normal = charts.normal()
        points = charts.points(own, across, down) + LIFT_M * normal[own]
        frame = np.stack([charts.axis_u[own], charts.axis_v[own], normal[own]], axis=1)
        clear, behind = np.zeros(len(own)), np.zeros(len(own))
        for direction in hemisphere():
            ray = np.einsum("i,nij->nj", direction, frame)
            depth, met = self._caster.cast(points, ray)
            clear += np.minimum(depth, REACH_M) / REACH_M / RAYS
            behind += (met != MISS) & (np.einsum("ij,ij->i", normal[met], ray) > 0)
        spread(clear, behind > INSIDE * RAYS, first, self.rows[new], self.columns[new])
        end = self._used + len(own)
        if end > len(
            self.light
        ):  # twice as much: one chart after the other must not copy all that went before each time
            grown = np.ones(max(end, 2 * len(self.light)), np.float32)
            grown[: self._used] = self.light[: self._used]
            self.light = grown
        self.light[self._used : end] = LEAST + (1 - LEAST) * clear
        self.place[new] = self._used + first
        self._used = end


@njit(cache=True)
def spread(clear: np.ndarray, inside: np.ndarray, first: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> None:
    """Places inside of something take the mean of those beside them that are not, ring by ring; grids begin at first (k,)."""
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


def hemisphere() -> np.ndarray:
    """Unit directions (RAYS, 3) about +z, as dense as a matt surface weighs them: a spiral of equal steps."""
    share = (np.arange(RAYS) + 0.5) / RAYS
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(RAYS)
    radius = np.sqrt(share)
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1 - share)])
