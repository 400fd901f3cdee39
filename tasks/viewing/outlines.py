"""Outlines of buildings as a map shows them: their roofs seen from above."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

from facade_core.atlas.table_schema import TableValues
from facade_core.core.grouping import group_rows
from facade_core.geometry.charts import ChartKind

# Corners that change an outline by less are left out, and gaps between triangles are closed, metres.
OUTLINE_TOLERANCE_M = 0.2
# Triangles with less area seen from above do not count, square metres.
MIN_TRIANGLE_M2 = 0.01
# Smaller rings, such as of dormers and chimneys, are left out, square metres.
MIN_RING_M2 = 2.0


class BuildingOutline(NamedTuple):
    """Outline of a building.

    Attributes
    ----------
    building : row of the building.
    is_own : the block textures the building; others only stand around.
    rings : corners [east, north] of each ring, metres; holes too, so that an even-odd fill leaves yards open.
    """

    building: int
    is_own: bool
    rings: list[list[list[float]]]


def outline_buildings(charts: TableValues, mesh: TableValues) -> list[BuildingOutline]:
    """Compute the outlines of all buildings of a plan, in the order of the buildings.

    Parameters
    ----------
    charts, mesh : tables of the plan.
    """
    is_roof = charts["kind"][mesh["triangle_chart"]] == ChartKind.ROOF
    corners = mesh["vertices"][mesh["triangles"][is_roof], :2]
    edges = corners[:, 1:] - corners[:, :1]
    area = np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]) / 2
    building = charts["building"][mesh["triangle_chart"][is_roof]]
    kept = (area > MIN_TRIANGLE_M2) & (building >= 0)
    triangles, building = shapely.polygons(corners[kept]), building[kept]
    own = set(charts["building"][charts["own"]].tolist()) if "own" in charts else set(building.tolist())
    return [
        BuildingOutline(row, row in own, _rings(shapely.union_all(triangles[members])))
        for row, members in sorted(group_rows(building).items())
    ]


def _rings(shape: shapely.Geometry) -> list[list[list[float]]]:
    closed = shape.buffer(OUTLINE_TOLERANCE_M, join_style="mitre").buffer(-OUTLINE_TOLERANCE_M, join_style="mitre")
    rings = [
        ring
        for ring in shapely.get_rings(closed.simplify(OUTLINE_TOLERANCE_M))
        if shapely.Polygon(ring).area > MIN_RING_M2
    ]
    return [np.round(shapely.get_coordinates(ring)[:-1], 1).tolist() for ring in rings]
