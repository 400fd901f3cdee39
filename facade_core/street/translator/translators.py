"""Translators: a partially textured panorama into a fully textured one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from facade_core.core.types import Ground, Street
from facade_core.geometry.raycast import MISS
from facade_core.geometry.scene import Scene
from facade_core.street.materials.field import MaterialField
from facade_core.street.materials.grain import GrainTables
from facade_core.street.materials.tiled_material import TiledMaterial
from facade_core.street.propagation.render import Panorama

# A surface is seen no flatter than this (cosine): what a pixel covers of it near the horizon is counted as this much.
MIN_VIEW_COSINE = 0.02


class Translator(Protocol):
    """Anything that textures a panorama."""

    def translate(self, panorama: Panorama) -> np.ndarray:
        """The fully textured panorama, (h, w, 3) uint8."""
        ...


class MaterialFieldTranslator:
    """What charts are made of, for ground, roofs, bare walls and what is in them; textured pixels are kept.

    The `materials` are functions of the world point, so that every viewpoint paints the same ground.
    """

    def __init__(
        self,
        scene: Scene,
        streets: Sequence[Street],
        *,
        seed: int,
        roof_material: TiledMaterial | None = None,
        ground: Ground | None = None,
        grains: GrainTables | None = None,
    ) -> None:
        self._normal = scene.charts.normal()
        self.materials = MaterialField(scene, streets, seed=seed, roof_material=roof_material, ground=ground, grains=grains)

    def translate(self, panorama: Panorama) -> np.ndarray:
        rgb = panorama.rgb.copy()
        bare = (panorama.chart != MISS) & ~panorama.textured
        chart, points = panorama.chart[bare], panorama.points[bare]
        covered = pixel_footprint(points - panorama.viewpoint.position, self._normal[chart], rgb.shape[1])
        rgb[bare] = self.materials.colour(chart, points, covered)
        return rgb


def pixel_footprint(ray: np.ndarray, normal: np.ndarray, width: int) -> np.ndarray:
    """What pixels of a panorama, `width` of them around, cover where rays (n, 3) from it end on surfaces with normals (n, 3) or
    (3,): the side of a square as large, metres, (n,)."""
    depth = np.maximum(np.linalg.norm(ray, axis=1), 1e-6)
    flat = np.abs((ray * normal).sum(axis=1)) / depth
    return depth * (2 * np.pi / width) / np.sqrt(np.maximum(flat, MIN_VIEW_COSINE))
