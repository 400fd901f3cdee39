"""Surfaces of a block as polygons with heights, for GIS layers."""

from __future__ import annotations

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from facade_core.core.arrays import IntArray
from facade_core.export.bodies.openings import chart_outlines
from facade_core.export.models.textured_mesh import TexturedMesh


def chart_world_polygons(source: TexturedMesh, charts: IntArray) -> dict[int, MultiPolygon]:
    """Return the outlines of charts (k,) with triangles as 3D polygons in world metres, valid on a map.

    Upright charts have no area on a map and are left out.
    """
    found = {}
    for chart in charts.tolist():
        parts = []
        for flat in chart_outlines(source.coordinates[source.mesh.triangles[source.mesh.chart_triangles(chart)]]):
            rings = [
                source.charts.points(chart, *np.asarray(ring.coords).T) for ring in (flat.exterior, *flat.interiors)
            ]
            parts.append(Polygon(rings[0], rings[1:]))
        shape = MultiPolygon(parts)
        if not shape.is_valid:
            repaired = shapely.get_parts(shapely.get_parts(shapely.make_valid(shape)))
            shape = MultiPolygon(repaired[shapely.get_dimensions(repaired) == 2].tolist())
        if shape.area > 0:
            found[chart] = shape
    return found


def height_range(source: TexturedMesh, triangles: IntArray) -> tuple[float, float]:
    """Return the lowest and highest corner of triangles (t,), metres."""
    corners = source.mesh.vertices[source.mesh.triangles[triangles], 2]
    return float(corners.min()), float(corners.max())
