"""Footprints of buildings from the surfaces above them."""

from __future__ import annotations

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from facade_core.core.arrays import IntArray
from facade_core.core.grouping import group_rows
from facade_core.export.models.textured_mesh import TexturedMesh
from facade_core.geometry.charts import ChartKind

# Grid on which corners are snapped so that nearly shared edges meet, metres.
SNAP_GRID_M = 0.001
# Ceilings at least this far below the lowest corner of the roofs are undersides or passages, no eaves; metres.
MIN_BELOW_ROOF_M = 0.1
# Minimum area of a part of a footprint, m2.
MIN_PART_M2 = 0.1


def building_footprint(source: TexturedMesh, triangles: IntArray) -> list[Polygon]:
    """Compute the footprint of a building: the area under its roofs without eaves.

    Eaves have a ceiling below them; the area over a passage counts. If the ceilings of eaves cover everything, or there
    is no roof, all surfaces count.

    Parameters
    ----------
    source : textured mesh.
    triangles : (t,) triangles of the building.
    """
    kind = source.charts.kind[source.mesh.chart[triangles]]
    roof = triangles[kind == ChartKind.ROOF]
    covered = _covered_area(source, roof if len(roof) else triangles)
    height = source.mesh.vertices[source.mesh.triangles[triangles], 2]
    eaves = height.max(axis=1) > height[kind == ChartKind.ROOF].min(initial=np.inf) - MIN_BELOW_ROOF_M
    open_below = _covered_area(source, triangles[(kind == ChartKind.CEILING) & eaves])
    standing = _polygon_parts(shapely.difference(covered, open_below, grid_size=SNAP_GRID_M)) if len(roof) else []
    return standing or _polygon_parts(covered)


def _covered_area(source: TexturedMesh, triangles: IntArray) -> shapely.Geometry:
    flat = shapely.polygons(source.mesh.vertices[source.mesh.triangles[triangles]][..., :2])
    return shapely.union_all(flat[shapely.area(flat) > SNAP_GRID_M**2], grid_size=SNAP_GRID_M)


def _polygon_parts(covered: shapely.Geometry) -> list[Polygon]:
    parts = shapely.get_parts(covered)
    return [part for part in parts if part.geom_type == "Polygon" and part.area >= MIN_PART_M2]


def building_footprints(source: TexturedMesh) -> dict[int, MultiPolygon]:
    """Compute the footprint of every building that has one."""
    parts = {
        building: building_footprint(source, triangles)
        for building, triangles in group_rows(source.charts.building[source.mesh.chart]).items()
        if building >= 0
    }
    return {building: MultiPolygon(polygons) for building, polygons in parts.items() if polygons}
