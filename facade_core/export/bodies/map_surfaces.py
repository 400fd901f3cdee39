"""Surfaces of a block as polygons with heights, for GIS layers."""

from __future__ import annotations

import numpy as np
from shapely import MultiPolygon, Polygon

from facade_core.core.arrays import IntArray
from facade_core.export.bodies.openings import chart_outlines
from facade_core.export.models.textured_mesh import TexturedMesh


def chart_world_polygons(source: TexturedMesh, charts: IntArray) -> dict[int, MultiPolygon]:
    """Return the outlines of charts (k,) with triangles as 3D polygons in world metres."""
    found = {}
    for chart in charts.tolist():
        parts = []
        for flat in chart_outlines(source.coordinates[source.mesh.triangles[source.mesh.chart_triangles(chart)]]):
            rings = [
                source.charts.points(chart, *np.asarray(ring.coords).T) for ring in (flat.exterior, *flat.interiors)
            ]
            parts.append(Polygon(rings[0], rings[1:]))
        if parts:
            found[chart] = MultiPolygon(parts)
    return found


def height_range(source: TexturedMesh, triangles: IntArray) -> tuple[float, float]:
    """Return the lowest and highest corner of triangles (t,), metres."""
    corners = source.mesh.vertices[source.mesh.triangles[triangles], 2]
    return float(corners.min()), float(corners.max())
