"""Translators: a partially textured panorama into a fully textured one."""

from __future__ import annotations

from typing import Protocol


from facade_core.core.arrays import Float64Array, UInt8Array
from facade_core.export.pictures.preview import pixel_footprint
from facade_core.geometry.raycast import MISS
from facade_core.geometry.scene import Scene
from facade_core.street.materials.field import MaterialField
from facade_core.street.propagation.render import RenderedPanorama


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
