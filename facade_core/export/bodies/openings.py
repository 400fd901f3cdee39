"""Outlines of charts, and the windows and doors placed in them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from shapely import Polygon

from facade_core.core.arrays import Float64Array
from facade_core.core.types import Element
from facade_core.export.bodies.settings import WALL_OPENINGS

# Doors are placed first, because people walk through them; shops last, because their windows and doors are in them.
OPENING_ORDER = ("door", "window", "shop")


def chart_outlines(corners: Float64Array) -> list[Polygon]:
    """Merge the triangles of a chart to polygons with all corners kept.

    Triangles that overlap or gape stay as they are.

    Parameters
    ----------
    corners : (t, 3, 2) in the chart's frame, y down.

    Returns
    -------
    Polygons whose exterior is counter-clockwise as seen from outside.
    """
    triangles = shapely.polygons(corners)
    triangles = triangles[shapely.area(triangles) > 0]
    if not len(triangles):
        return []
    whole = shapely.area(triangles).sum()
    try:
        union = shapely.coverage_union_all(triangles)
    except shapely.GEOSException:  # the triangles are no coverage
        union = shapely.MultiPolygon()
    if abs(union.area - whole) > WALL_OPENINGS.max_area_difference * whole or not union.is_valid:
        union = shapely.MultiPolygon(list(triangles))
    return _orient_polygons(union)


def place_openings(wall: Polygon, elements: Sequence[Element]) -> list[tuple[Element, Polygon]]:
    """Return doors, windows and shops with their polygons in a wall, clipped and kept apart.

    Parameters
    ----------
    wall : outline of the wall in its chart's frame.
    elements : elements in metres, y down from the chart's top left.
    """
    openings: list[tuple[Element, Polygon]] = []
    inner = wall.buffer(-WALL_OPENINGS.wall_edge_m, join_style="mitre")
    taken: list[Polygon] = []
    wanted = [e for e in elements if e.label in OPENING_ORDER]
    for element in sorted(wanted, key=lambda e: (OPENING_ORDER.index(e.label), -e.width * e.height, e.x0, e.y0)):
        box = shapely.box(element.x0, element.y0, element.x1, element.y1)
        near = [taken[k] for k in np.flatnonzero(shapely.intersects(taken, box)).tolist()]
        free = box.intersection(inner).difference(shapely.union_all(near)) if near else box.intersection(inner)
        parts = [
            part
            for part in shapely.get_parts(free)
            if part.geom_type == "Polygon" and not part.interiors and part.area >= WALL_OPENINGS.min_opening_m2
        ]
        if parts:
            opening = max(parts, key=lambda part: part.area).simplify(WALL_OPENINGS.wall_edge_m / 2)
            if not opening.buffer(-WALL_OPENINGS.min_opening_width_m / 2).is_empty:
                openings.append((element, _orient_polygons(opening)[0]))
                taken.append(opening.buffer(WALL_OPENINGS.opening_gap_m, join_style="mitre"))
    return openings


def _orient_polygons(area: shapely.Geometry) -> list[Polygon]:
    """Orient exteriors counter-clockwise as seen from outside: clockwise where y counts up."""
    parts = [part for part in shapely.get_parts(area) if part.geom_type == "Polygon" and not part.is_empty]
    return [shapely.orient_polygons(part, exterior_cw=True) for part in parts]
