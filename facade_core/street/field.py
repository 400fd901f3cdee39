"""What charts are made of where no picture shows it, as a field: a function of chart and world point."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.geometry.charts import CEILING, DOOR, GROUND, ROOF, WALL, WINDOW
from facade_core.street.centrelines import Centrelines
from facade_core.street.materials import asphalt, glass, paving, plaster, roofing, soffit, tiling, wood
from facade_core.street.render import shade
from facade_core.street.scene import Scene
from facade_core.street.tiled import Material
from facade_core.types import Street

CARRIAGEWAY_M = 3.6
KERB_M = 0.18
# How far from a centreline the ground takes its colours from it: beyond, no distance is asked for.
BESIDE_M = CARRIAGEWAY_M + 2 * KERB_M
# A roof whose normal leans more than this from the vertical (cosine) carries tiles.
TILED = 0.985


class Materials:
    """What charts are made of: a function of the world point, the same wherever it is seen from.

    Ground is carriageway along the centrelines, kerb, and paving beyond; walls take their building's plaster, tilted roofs
    tiles along the slope; with a material for roofs, all of these take that. A footprint is the side of the square, in
    metres, over which a colour is meant; a texel's is one texel.
    """

    def __init__(
        self, scene: Scene, streets: Sequence[Street], *, seed: int, roof_material: Material | None = None
    ) -> None:
        self._scene = scene
        self._roof = roof_material
        self._seed = seed
        self._centrelines = Centrelines(streets, BESIDE_M)
        charts, mesh = scene.charts, scene.mesh
        own = mesh.vertex_chart
        wall = charts.kind[own] == WALL
        # where each building's walls begin
        self._foot = np.full(int(charts.building.max(initial=-1)) + 1, np.inf)
        np.minimum.at(self._foot, charts.building[own[wall]], mesh.vertices[wall, 2])

    def colour(self, chart: np.ndarray, points: np.ndarray, footprint: np.ndarray) -> np.ndarray:
        """Shaded material of world points (n, 3) on charts (n,) with footprints (n,): (n, 3) uint8."""
        charts = self._scene.charts
        albedo = np.zeros((len(chart), 3))
        kind = charts.kind[chart]
        if (ground := kind == GROUND).any():
            albedo[ground] = self._ground(points[ground])
        building = charts.building[chart]
        number = self._scene.building_numbers[building]
        along, down = charts.coordinates(chart, points).T
        flat = charts.normal()[:, 2][chart] > TILED
        roof = kind == ROOF
        if self._roof is not None and roof.any():
            albedo[roof] = self._laid(self._roof, chart[roof], points[roof])
        elif roof.any():
            sheet, tiled = roof & flat, roof & ~flat
            albedo[sheet] = roofing(points[sheet], number[sheet], self._seed)
            albedo[tiled] = tiling(along[tiled], down[tiled], number[tiled], self._seed)
        if (wall := kind == WALL).any():
            above = points[wall, 2] - self._foot[building[wall]]
            albedo[wall] = plaster(along[wall], down[wall], above, number[wall], self._seed)
        if (window := kind == WINDOW).any():
            albedo[window] = glass(along[window], down[window], charts.size[chart[window], 1], self._seed)
        if (door := kind == DOOR).any():
            albedo[door] = wood(along[door], down[door], number[door], self._seed)
        if (ceiling := kind == CEILING).any():
            albedo[ceiling] = soffit(along[ceiling], down[ceiling], self._seed)
        return np.clip(albedo * shade(charts.normal()[chart])[:, None], 0, 255).astype(np.uint8)

    def texels(self, chart: int, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Texels (k,) of a chart at their middles: (k, 3) uint8."""
        step = 1 / self._scene.spec.texels_per_metre
        points = self._scene.charts.points(chart, step * (columns + 0.5), step * (rows + 0.5))
        return self.colour(np.full(len(points), chart), points, np.full(len(points), step))

    def raster(self, chart: int) -> np.ndarray:
        """A whole chart: (h, w, 3) uint8."""
        shape = (int(self._scene.placement.height[chart]), int(self._scene.placement.width[chart]))
        rows, columns = np.divmod(np.arange(shape[0] * shape[1]), shape[1])
        return self.texels(chart, rows, columns).reshape(*shape, 3)

    def _laid(self, material: Material, chart: np.ndarray, points: np.ndarray) -> np.ndarray:
        """The material at points (n, 3) of roofs (n,), in the frames of their planes: it goes on over the pieces of one."""
        charts = self._scene.charts
        across = np.einsum("ij,ij->i", points, charts.axis_u[chart])
        return material.laid(across, np.einsum("ij,ij->i", points, charts.axis_v[chart]))

    def _ground(self, points: np.ndarray) -> np.ndarray:
        aside = self._centrelines.distance(points[:, :2])
        road = aside < CARRIAGEWAY_M
        kerb = np.abs(aside - CARRIAGEWAY_M) < KERB_M
        colour = paving(points, self._seed)
        colour[road] = asphalt(points[road], aside[road], self._seed)
        colour[kerb] = 150 + 0.25 * (colour[kerb] - 150)
        return colour
