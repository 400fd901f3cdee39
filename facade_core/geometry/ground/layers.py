"""What covers the ground, as shapes in layers: areas and paths by surface, pavements, carriageways on top of all."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from shapely import LineString, Polygon

from facade_core.core.types import SURFACES, Area, Way

# Layers from below: areas and paths by surface, pavements between them, carriageways on top of all.
AREAS, PAVEMENT, PATHS, ROAD = 0, len(SURFACES), len(SURFACES) + 1, 2 * len(SURFACES) + 1
# Radius of a kerb round a corner, and how far from a junction it may reach.
CORNER_M, JUNCTION_M = 5.0, 14.0
# What is narrower between two parts of a shape is closed.
SLIT_M = 0.02


def carriageways(roads: Sequence[Way]) -> tuple[shapely.Geometry, shapely.Geometry]:
    """The union of carriageways with kerbs round their corners, and where roads meet."""
    if not roads:
        return Polygon(), Polygon()
    lines = np.array([way.line for way in roads])
    half = np.array([way.width / 2 for way in roads])
    bands = shapely.buffer(lines, half, cap_style="flat", join_style="mitre", mitre_limit=2.0)
    tree = shapely.STRtree(lines)
    ends = shapely.points(np.concatenate([[way.line.coords[0], way.line.coords[-1]] for way in roads]))
    own = np.repeat(np.arange(len(roads)), 2)
    end, other = tree.query(ends, predicate="dwithin", distance=0.05)
    met = own[end] != other
    end, other = end[met], other[met]
    # roads that end on each other go on: their ends are round, as wide as the narrower
    joints = shapely.buffer(ends[end], np.minimum(half[own[end]], half[other]), quad_segs=8)
    meet = [
        ends[i] for i, j in zip(end.tolist(), other.tolist(), strict=True) if _turns(roads[own[i]], roads[j], ends[i])
    ]
    union = shapely.union_all([*bands, *joints])
    if not meet:
        return union, Polygon()
    junctions = shapely.union_all(shapely.buffer(np.array(meet), JUNCTION_M))
    closed = union.buffer(CORNER_M, quad_segs=8).buffer(-CORNER_M, quad_segs=8)
    corners = closed.difference(union).intersection(junctions)
    return shapely.union_all([union, *(part for part in shapely.get_parts(corners) if part.area > 0.01)]), (
        shapely.multipoints(meet)
    )


def _turns(way: Way, other: Way, place: shapely.Point) -> bool:
    """Whether two roads that meet at a place are no continuation of each other."""
    one, two = (_direction(line, place) for line in (way.line, other.line))
    return abs(one[0] * two[1] - one[1] * two[0]) > 0.5


def _direction(line: LineString, place: shapely.Point) -> np.ndarray:
    along = line.project(place)
    low, high = max(along - 3.0, 0.0), min(along + 3.0, line.length)
    ends = shapely.get_coordinates(shapely.line_interpolate_point(line, [low, high]))
    return (ends[1] - ends[0]) / max(float(np.hypot(*(ends[1] - ends[0]))), 1e-9)


def layers_of(areas: Sequence[Area], ways: Sequence[Way], carriageway: shapely.Geometry) -> dict[int, shapely.Geometry]:
    """What covers the ground, from below: the shape of each layer. carriageway: of these ways."""
    roads = [way for way in ways if way.kind == "road"]
    shapes: dict[int, list[shapely.Geometry]] = {}
    for area in areas:
        shapes.setdefault(AREAS + SURFACES.index(area.surface), []).append(area.outline)
    for way in roads:
        for side, wide in zip((1.0, -1.0), way.pavement, strict=True):
            if wide > 0:
                strip = way.line.buffer(side * (way.width / 2 + wide), single_sided=True, join_style="mitre")
                shapes.setdefault(PAVEMENT, []).append(strip)
        if min(way.pavement) > 0:
            for end in (way.line.coords[0], way.line.coords[-1]):
                if sum(shapely.distance(other.line, shapely.Point(end)) < 0.05 for other in roads) > 1:
                    reach = way.width / 2 + min(way.pavement)
                    shapes.setdefault(PAVEMENT, []).append(shapely.Point(end).buffer(reach))
    for way in ways:
        if way.kind in ("path", "cycle", "steps"):
            shape = way.line.buffer(way.width / 2, cap_style="flat" if way.kind == "steps" else "round")
            shapes.setdefault(PATHS + SURFACES.index(way.surface), []).append(shape)
    if not carriageway.is_empty:
        shapes[ROAD] = [carriageway]
    return {layer: _whole(shapely.union_all(found)) for layer, found in sorted(shapes.items())}


def _whole(shape: shapely.Geometry) -> shapely.Geometry:
    """A shape without slits, of which an edge has the inside on its left."""
    closed = shape.buffer(SLIT_M, join_style="mitre").buffer(-SLIT_M, join_style="mitre")
    return shapely.orient_polygons(closed.simplify(SLIT_M / 4))
