"""Translators: a partially textured panorama into a fully textured one."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from facade_core.core.arrays import Float64Array, UInt8Array
from facade_core.geometry.raycast import MISS
from facade_core.geometry.scene import Scene
from facade_core.street.materials.field import MaterialField
from facade_core.street.propagation.render import RenderedPanorama

# Lower bound of the cosine of incidence, for footprints near the horizon.
MIN_VIEW_COSINE = 0.02


class Translator(Protocol):
    """Interface of all translators."""

    def translate(self, panorama: RenderedPanorama) -> UInt8Array:
        """Return the fully textured panorama, (h, w, 3) uint8."""
        ...


class MaterialFieldTranslator:
    """Translator that paints untextured pixels from the material field.

    `materials` is a function of the world point, so that every viewpoint paints the same ground.
    """

    def __init__(self, scene: Scene, materials: MaterialField) -> None:
        self._normal = scene.charts.normals()
        self.materials = materials

    def translate(self, panorama: RenderedPanorama) -> UInt8Array:
        """Return the fully textured panorama, (h, w, 3) uint8."""
        return paint_bare_pixels(panorama, self.materials, self._normal)


def paint_bare_pixels(panorama: RenderedPanorama, materials: MaterialField, normals: Float64Array) -> UInt8Array:
    """Paint the untextured pixels of a panorama with their materials.

    Parameters
    ----------
    panorama : partially textured panorama.
    materials : material field of the block.
    normals : (n, 3) unit normals of the charts.

    Returns
    -------
    (h, w, 3) uint8.
    """
    rgb = panorama.rgb.copy()
    bare = (panorama.chart != MISS) & ~panorama.textured
    chart, points = panorama.chart[bare], panorama.points[bare]
    covered = pixel_footprint(points - panorama.viewpoint.position, normals[chart], rgb.shape[1])
    rgb[bare] = materials.colour(chart, points, covered)
    return rgb


def pixel_footprint(ray: Float64Array, normal: Float64Array, width: int) -> Float64Array:
    """Compute the footprint of panorama pixels on surfaces.

    Parameters
    ----------
    ray : (n, 3) from the viewpoint to the surface, metres.
    normal : (n, 3) or (3,) unit normals.
    width : width of the panorama, pixels.

    Returns
    -------
    (n,) side of a square of equal area, metres.
    """
    depth = np.maximum(np.linalg.norm(ray, axis=1), 1e-6)
    flat = np.abs((ray * normal).sum(axis=1)) / depth
    footprint: Float64Array = depth * (2 * np.pi / width) / np.sqrt(np.maximum(flat, MIN_VIEW_COSINE))
    return footprint
