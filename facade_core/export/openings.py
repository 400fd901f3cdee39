"""Charts as polygons, and walls with the windows and doors of their layout cut out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from shapely import Polygon

from facade_core.types import Element

# A polygon is taken for its triangles when their areas differ by no more than this share.
SAME_AREA = 1e-3
# No smaller opening is cut, m2, nor a piece of wall kept that is left between openings.
SMALLEST_OPENING_M2, SMALLEST_WALL_M2 = 0.05, 1e-4
# Doors are cut before windows: where both are stated, people walk through.
OPENINGS = ("door", "window")


def outlines(corners: np.ndarray) -> list[Polygon]:
    """The polygons that triangles (t, 3, 2) of one chart make up, corners kept; the triangles where they overlap or gape.

    Coordinates are the chart's, y down; exterior rings run counter-clockwise as seen from outside.
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
    if abs(union.area - whole) > SAME_AREA * whole or not union.is_valid:
        union = shapely.MultiPolygon(list(triangles))
    return _seen(union)


def cut_openings(wall: Polygon, elements: Sequence[Element]) -> tuple[list[Polygon], list[tuple[Element, Polygon]]]:
    """A wall in its chart's frame without its doors and windows, and these, clipped to the wall and free of each other.

    elements are in metres, y down from the chart's top left. Openings on the wall's border notch it.
    """
    openings: list[tuple[Element, Polygon]] = []
    taken = Polygon()
    wanted = [e for e in elements if e.label in OPENINGS]
    for element in sorted(wanted, key=lambda e: (OPENINGS.index(e.label), -e.width * e.height)):
        box = shapely.box(element.x0, element.y0, element.x1, element.y1)
        free = [
            part
            for part in shapely.get_parts(box.intersection(wall).difference(taken))
            if part.geom_type == "Polygon" and part.area >= SMALLEST_OPENING_M2
        ]
        if free:
            opening = max(free, key=lambda part: part.area)
            openings.append((element, _seen(opening)[0]))
            taken = taken.union(opening)
    rest = [part for part in _seen(wall.difference(taken)) if part.area >= SMALLEST_WALL_M2]
    return rest, openings


def _seen(area: shapely.Geometry) -> list[Polygon]:
    """Polygons with the exterior counter-clockwise as seen from outside: clockwise where y counts up."""
    parts = [part for part in shapely.get_parts(area) if part.geom_type == "Polygon" and not part.is_empty]
    return [shapely.orient_polygons(part, exterior_cw=True) for part in parts]
