"""Translators: a partially textured panorama into a fully textured one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
import shapely

from facade_core.geometry.charts import GROUND, ROOF, WALL
from facade_core.geometry.raycast import MISS
from facade_core.street.materials import asphalt, paving, plaster, roofing
from facade_core.street.render import Panorama, shade
from facade_core.street.scene import Scene
from facade_core.types import Street

CARRIAGEWAY_M = 3.6
KERB_M = 0.18


class Translator(Protocol):
    """Anything that textures a panorama."""

    def translate(self, panorama: Panorama) -> np.ndarray:
        """The fully textured panorama, (h, w, 3) uint8."""
        ...


class Swatches:
    """Material swatches with shading for ground, roofs and bare walls; textured pixels are kept.

    Materials are functions of the world point, so that every viewpoint paints the same ground: carriageway along the
    centrelines, kerb, paving beyond. Walls take their building's plaster.
    """

    def __init__(self, scene: Scene, streets: Sequence[Street], *, seed: int) -> None:
        self._scene = scene
        self._seed = seed
        self._centrelines = shapely.union_all([street.line for street in streets])
        shapely.prepare(self._centrelines)

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
        if (roof := kind == ROOF).any():
            albedo[roof] = roofing(points[roof], charts.building[chart[roof]], self._seed)
        if (wall := kind == WALL).any():
            owner = chart[wall]
            relative = points[wall] - charts.origin[owner]
            along = np.einsum("ij,ij->i", relative, charts.axis_u[owner])
            down = np.einsum("ij,ij->i", relative, charts.axis_v[owner])
            above = points[wall][:, 2]
            albedo[wall] = plaster(along, down, above, charts.building[owner], self._seed)
        return np.clip(albedo * shade(charts.normal()[chart])[:, None], 0, 255).astype(np.uint8)

    def _ground(self, points: np.ndarray) -> np.ndarray:
        aside = shapely.distance(self._centrelines, shapely.points(points[:, :2]))
        road = aside < CARRIAGEWAY_M
        kerb = np.abs(aside - CARRIAGEWAY_M) < KERB_M
        colour = paving(points, self._seed)
        colour[road] = asphalt(points[road], aside[road], self._seed)
        colour[kerb] = 150 + 0.25 * (colour[kerb] - 150)
        return colour
