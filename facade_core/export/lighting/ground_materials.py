"""Surface materials of ground charts from the map."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import shapely

from facade_core.core.arrays import UInt8Array
from facade_core.core.types import SURFACES, GroundWay, MappedGround
from facade_core.export.lighting.pbr_materials import GROUND_MATERIALS, PbrMaterialClass
from facade_core.geometry.charts import Charts

# Fixed-point bits of rasterised outlines.
FIXED_POINT_BITS = 4


class GroundMaterialOutlines:
    """Outlines of a block's ground materials in painting order: areas, pavements, paths, roads by rank."""

    def __init__(self, ground: MappedGround) -> None:
        self._ground = ground

    def rasterise(self, charts: Charts, chart: int, shape: tuple[int, int]) -> UInt8Array:
        """Rasterise the materials of a ground chart.

        Parameters
        ----------
        charts : charts of the block.
        chart : id of the ground chart.
        shape : (h, w) of the raster.

        Returns
        -------
        (h, w) uint8 PbrMaterial.
        """
        import cv2

        out = np.full(shape, PbrMaterialClass.GRAVEL, np.uint8)
        shapes, tree = self._outlines, self._tree
        origin, axes = charts.origin[chart, :2], np.stack([charts.axis_u[chart, :2], charts.axis_v[chart, :2]])
        axes = axes / (axes**2).sum(axis=1, keepdims=True)  # places as seen from above
        texels = np.array([shape[1], shape[0]]) / charts.size[chart]
        for number in np.sort(tree.query(charts.boxes[chart])).tolist():
            outline, of = shapes[number]
            for part in shapely.get_parts(outline):
                rings = [
                    np.round(
                        (((np.asarray(ring.coords)[:, :2] - origin) @ axes.T) * texels - 0.5) * 2**FIXED_POINT_BITS
                    )
                    for ring in (part.exterior, *part.interiors)
                ]
                cv2.fillPoly(
                    out,
                    [np.clip(ring, -(2**26), 2**26).astype(np.int32) for ring in rings],
                    of,
                    cv2.LINE_8,
                    FIXED_POINT_BITS,
                )
        return out

    @cached_property
    def _outlines(self) -> list[tuple[shapely.Geometry, int]]:
        areas = [(one.outline, GROUND_MATERIALS[SURFACES.index(one.surface)]) for one in self._ground.areas]
        roads = sorted((way for way in self._ground.ways if way.kind == "road"), key=lambda way: way.rank)
        paths = [way for way in self._ground.ways if way.kind in ("path", "cycle", "steps")]
        outlines = [*areas, *_pavement_outlines(roads), *_surface_outlines([*paths, *roads])]
        return [(shape, of) for shape, of in outlines if shape.geom_type.endswith("Polygon") and not shape.is_empty]

    @cached_property
    def _tree(self) -> shapely.STRtree:
        return shapely.STRtree([shape for shape, _ in self._outlines])


def _pavement_outlines(roads: Sequence[GroundWay]) -> list[tuple[shapely.Geometry, int]]:
    return [
        (way.line.buffer(way.width / 2 + max(way.pavement)), PbrMaterialClass.SLABS)
        for way in roads
        if max(way.pavement) > 0
    ]


def _surface_outlines(ways: Sequence[GroundWay]) -> list[tuple[shapely.Geometry, int]]:
    return [(way.line.buffer(way.width / 2), GROUND_MATERIALS[SURFACES.index(way.surface)]) for way in ways]
