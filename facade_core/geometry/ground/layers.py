"""Layers of the ground as shapes: areas and paths by surface, pavements, carriageways on top."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from shapely import LineString, Polygon
from shapely.ops import substring

from facade_core.core.arrays import Float64Array
from facade_core.core.types import SURFACES, GroundArea, GroundWay
from facade_core.geometry.ground.settings import LAYERS

# Layers, lowest first: areas by surface, pavements, paths by surface, carriageways.
FIRST_AREA_LAYER = 0
PAVEMENT_LAYER = len(SURFACES)
FIRST_PATH_LAYER = PAVEMENT_LAYER + 1
ROAD_LAYER = FIRST_PATH_LAYER + len(SURFACES)


def join_carriageways(roads: Sequence[GroundWay]) -> tuple[shapely.Geometry, shapely.Geometry]:
    """Return the union of carriageways with rounded kerbs at corners, and the points of junctions."""
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
    # roads that end on each other continue: a round joint as wide as the narrower one
    joints = shapely.buffer(ends[end], np.minimum(half[own[end]], half[other]), quad_segs=8)
    meet = [
        ends[i]
        for i, j in zip(end.tolist(), other.tolist(), strict=True)
        if _is_junction(roads[own[i]], roads[j], ends[i])
    ]
    union = shapely.union_all([*bands, *joints])
    if not meet:
        return union, Polygon()
    junctions = shapely.union_all(shapely.buffer(np.array(meet), LAYERS.junction_reach_m))
    closed = union.buffer(LAYERS.kerb_radius_m, quad_segs=8).buffer(-LAYERS.kerb_radius_m, quad_segs=8)
    corners = closed.difference(union).intersection(junctions)
    return shapely.union_all([union, *(part for part in shapely.get_parts(corners) if part.area > 0.01)]), (
        shapely.multipoints(meet)
    )


def join_driven_lanes(roads: Sequence[GroundWay]) -> shapely.Geometry:
    """Return the union of carriageways without the strips where cars park along them."""
    lanes = [
        lane
        for way in roads
        for side, parked in zip((1.0, -1.0), way.parking, strict=True)
        for lane in shapely.buffer(
            _open_lines(way.line), side * (way.width / 2 - parked), single_sided=True, join_style="mitre"
        )
    ]
    return shapely.union_all(lanes)


def _is_junction(way: GroundWay, other: GroundWay, place: shapely.Point) -> bool:
    """Return whether two roads that meet at a place form an angle."""
    one, two = (_direction_at(line, place) for line in (way.line, other.line))
    is_turning: bool = abs(one[0] * two[1] - one[1] * two[0]) > 0.5
    return is_turning


def _direction_at(line: LineString, place: shapely.Point) -> Float64Array:
    along = line.project(place)
    low, high = max(along - 3.0, 0.0), min(along + 3.0, line.length)
    ends = shapely.get_coordinates(shapely.line_interpolate_point(line, [low, high]))
    direction: Float64Array = (ends[1] - ends[0]) / max(float(np.hypot(*(ends[1] - ends[0]))), 1e-9)
    return direction


def ground_layers(
    areas: Sequence[GroundArea], ways: Sequence[GroundWay], carriageway: shapely.Geometry
) -> dict[int, shapely.Geometry]:
    """Return the shape of each ground layer, lowest first.

    Parameters
    ----------
    areas : mapped areas.
    ways : mapped ways.
    carriageway : union of the carriageways of these ways.
    """
    roads = [way for way in ways if way.kind == "road"]
    lines = np.array([way.line for way in roads], object)
    shapes: dict[int, list[shapely.Geometry]] = {}
    for area in areas:
        shapes.setdefault(FIRST_AREA_LAYER + SURFACES.index(area.surface), []).append(area.outline)
    for way in roads:
        for side, wide in zip((1.0, -1.0), way.pavement, strict=True):
            if wide > 0:
                strips = shapely.buffer(
                    _open_lines(way.line), side * (way.width / 2 + wide), single_sided=True, join_style="mitre"
                )
                shapes.setdefault(PAVEMENT_LAYER, []).extend(strips)
        if min(way.pavement) > 0:
            for end in (way.line.coords[0], way.line.coords[-1]):
                corner = shapely.Point(end)
                if np.count_nonzero(shapely.distance(lines, corner) < 0.05) > 1:
                    reach = way.width / 2 + min(way.pavement)
                    shapes.setdefault(PAVEMENT_LAYER, []).append(corner.buffer(reach))
    for way in ways:
        if way.kind in ("path", "cycle", "steps"):
            shape = way.line.buffer(way.width / 2, cap_style="flat" if way.kind == "steps" else "round")
            shapes.setdefault(FIRST_PATH_LAYER + SURFACES.index(way.surface), []).append(shape)
    if not carriageway.is_empty:
        shapes[ROAD_LAYER] = [carriageway]
    return {layer: _close_slits(shapely.union_all(found)) for layer, found in sorted(shapes.items())}


def _open_lines(line: LineString) -> list[LineString]:
    """Return a line, or the halves of a ring: GEOS buffers one side of open lines only."""
    return [substring(line, start, start + 0.5, normalized=True) for start in (0.0, 0.5)] if line.is_ring else [line]


def _close_slits(shape: shapely.Geometry) -> shapely.Geometry:
    """Return a shape without slits, with the inside on the left of its edges."""
    closed = shape.buffer(LAYERS.max_slit_m, join_style="mitre").buffer(-LAYERS.max_slit_m, join_style="mitre")
    return shapely.orient_polygons(closed.simplify(LAYERS.max_slit_m / 4))
