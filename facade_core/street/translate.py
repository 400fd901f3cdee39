"""Translators: a partially textured panorama into a fully textured one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from facade_core.geometry.raycast import MISS
from facade_core.street.field import Materials
from facade_core.street.render import Panorama
from facade_core.street.scene import Scene
from facade_core.street.tiled import Material
from facade_core.types import Street

# A surface is seen no flatter than this (cosine): what a pixel covers of it near the horizon is counted as this much.
FLATTEST = 0.02


class Translator(Protocol):
    """Anything that textures a panorama."""

    def translate(self, panorama: Panorama) -> np.ndarray:
        """The fully textured panorama, (h, w, 3) uint8."""
        ...


class Swatches:
    """What charts are made of, for ground, roofs, bare walls and what is in them; textured pixels are kept.

    The `materials` are functions of the world point, so that every viewpoint paints the same ground.
    """

    def __init__(
        self, scene: Scene, streets: Sequence[Street], *, seed: int, roof_material: Material | None = None
    ) -> None:
        self._normal = scene.charts.normal()
        self.materials = Materials(scene, streets, seed=seed, roof_material=roof_material)

    def translate(self, panorama: Panorama) -> np.ndarray:
        rgb = panorama.rgb.copy()
        bare = (panorama.chart != MISS) & ~panorama.textured
        chart, points = panorama.chart[bare], panorama.points[bare]
        rgb[bare] = self.materials.colour(chart, points, self._footprint(panorama, chart, points))
        return rgb

    def _footprint(self, panorama: Panorama, chart: np.ndarray, points: np.ndarray) -> np.ndarray:
        """What pixels of a panorama cover at points (n, 3) of charts (n,): the side of a square as large, metres, (n,)."""
        ray = points - panorama.viewpoint.position
        depth = np.maximum(np.linalg.norm(ray, axis=1), 1e-6)
        flat = np.abs(np.einsum("ij,ij->i", ray, self._normal[chart])) / depth
        return depth * (2 * np.pi / panorama.chart.shape[1]) / np.sqrt(np.maximum(flat, FLATTEST))
