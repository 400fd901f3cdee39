"""What buildings cover, from the surfaces that are above it."""

from __future__ import annotations

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from facade_core.export.models import Textured
from facade_core.geometry.charts import ROOF
from facade_core.grouping import grouped

# Corners are put on a grid of this many metres, so that edges that nearly meet do.
GRID_M = 0.001
# Nothing smaller is a part of a footprint, m2.
SMALLEST_M2 = 0.1


def footprint(source: Textured, triangles: np.ndarray) -> list[Polygon]:
    """What the roofs among some triangles of the mesh cover, from above; of all of them where none is a roof."""
    mesh = source.mesh
    roof = triangles[source.charts.kind[mesh.chart[triangles]] == ROOF]
    flat = shapely.polygons(mesh.vertices[mesh.triangles[roof if len(roof) else triangles]][..., :2])
    flat = flat[shapely.area(flat) > GRID_M**2]
    if not len(flat):
        return []
    parts = shapely.get_parts(shapely.union_all(flat, grid_size=GRID_M))
    return [part for part in parts if part.geom_type == "Polygon" and part.area >= SMALLEST_M2]


def footprints(source: Textured) -> dict[int, MultiPolygon]:
    """The footprint of every building that has one."""
    parts = {
        building: footprint(source, triangles)
        for building, triangles in grouped(source.charts.building[source.mesh.chart]).items()
        if building >= 0
    }
    return {building: MultiPolygon(polygons) for building, polygons in parts.items() if polygons}
