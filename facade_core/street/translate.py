"""Translators: a partially textured panorama into a fully textured one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from facade_core.geometry.charts import CEILING, DOOR, GROUND, ROOF, WALL, WINDOW
from facade_core.geometry.raycast import MISS
from facade_core.street.centrelines import Centrelines
from facade_core.street.materials import asphalt, glass, paving, plaster, roofing, soffit, tiling, wood
from facade_core.street.render import Panorama, shade
from facade_core.street.scene import Scene
from facade_core.street.tiled import Material
from facade_core.types import Street

CARRIAGEWAY_M = 3.6
KERB_M = 0.18
# How far from a centreline the ground takes its colours from it: beyond, no distance is asked for.
BESIDE_M = CARRIAGEWAY_M + 2 * KERB_M
# A roof whose normal leans more than this from the vertical (cosine) carries tiles.
TILED = 0.985


class Translator(Protocol):
    """Anything that textures a panorama."""

    def translate(self, panorama: Panorama) -> np.ndarray:
        """The fully textured panorama, (h, w, 3) uint8."""
        ...


class Swatches:
    """Material swatches with shading for ground, roofs, bare walls and what is in them; textured pixels are kept.

    Materials are functions of the world point, so that every viewpoint paints the same ground: carriageway along the
    centrelines, kerb, paving beyond. Walls take their building's plaster, tilted roofs tiles along the slope; with a material
    for roofs, all of these take that.
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

    def translate(self, panorama: Panorama) -> np.ndarray:
        rgb = panorama.rgb.copy()
        bare = (panorama.chart != MISS) & ~panorama.textured
        rgb[bare] = self.colour(panorama.chart[bare], panorama.points[bare])
        return rgb

    def colour(self, chart: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Shaded material of world points (n, 3) on charts (n,): (n, 3) uint8."""
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
