"""Soft light on what has no texture yet: how much of the sky each place of a chart sees, by rays, once per chart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.geometry.charts import Charts
from facade_core.geometry.raycast import RayCaster

# Metres between the places of a chart that are looked from; light is linear between them.
CELL_M = 2.0
RAYS = 24
# What stands farther than this takes no light.
REACH_M = 20.0
# Rays start this far off the surface: a vertex may lie centimetres off its chart's plane.
LIFT_M = 0.05
# Of the light, this much comes from everywhere.
LEAST = 0.35


class Daylight:
    """Light of charts on grids of their own, filled in as charts come into view.

    place (charts,) int64 where a chart's grid starts in `light`, -1 before it is computed; rows, columns (charts,) int64 its
    shape; light (k,) float32 in LEAST..1. The same for a chart whatever else was asked for before it.
    """

    def __init__(self, charts: Charts, caster: RayCaster) -> None:
        self._charts, self._caster = charts, caster
        cells = np.maximum(np.ceil(charts.size / CELL_M), 1).astype(np.int64)
        self.columns, self.rows = cells[:, 0].copy(), cells[:, 1].copy()
        self.place = np.full(len(charts), -1, np.int64)
        self.light = np.zeros(0, np.float32)

    def reach(self, wanted: Sequence[int] | np.ndarray) -> None:
        """Compute what is missing of some charts."""
        chosen = np.asarray(wanted, np.int64)
        new = chosen[self.place[chosen] < 0]
        if len(new) == 0:
            return
        count = self.rows[new] * self.columns[new]
        first = np.cumsum(count) - count
        own = np.repeat(new, count)
        row, column = np.divmod(np.arange(int(count.sum())) - np.repeat(first, count), self.columns[own])
        charts = self._charts
        across = (column + 0.5) / self.columns[own] * charts.size[own, 0]
        down = (row + 0.5) / self.rows[own] * charts.size[own, 1]
        normal = charts.normal()[own]
        points = charts.points(own, across, down) + LIFT_M * normal
        frame = np.stack([charts.axis_u[own], charts.axis_v[own], normal], axis=1)
        clear = np.zeros(len(own), np.float64)
        for direction in _hemisphere():
            ray = np.einsum("i,nij->nj", direction, frame)
            clear += np.minimum(self._caster.cast(points, ray)[0], REACH_M) / REACH_M
        self.place[new] = len(self.light) + first
        light = LEAST + (1 - LEAST) * clear / RAYS
        self.light = np.concatenate([self.light, light.astype(np.float32)])


def _hemisphere() -> np.ndarray:
    """Unit directions (RAYS, 3) about +z, as dense as a matt surface weighs them: a spiral of equal steps."""
    share = (np.arange(RAYS) + 0.5) / RAYS
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(RAYS)
    radius = np.sqrt(share)
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1 - share)])
