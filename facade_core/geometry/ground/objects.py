"""Placement of mapped objects: on the ground, clear of walls and carriageways."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
import shapely
from shapely import LineString, MultiPolygon, Point, Polygon

from facade_core.core.arrays import BoolArray
from facade_core.core.name_hash import hash_name
from facade_core.core.street_objects import (
    NO_OBJECTS,
    OBJECT_KIND_NAMES,
    Facing,
    ObjectKind,
    PlacedObjects,
    heading_axes,
    object_kind,
)
from facade_core.core.types import GroundObject, GroundWay, MappedGround
from facade_core.geometry.charts import ChartKind, Charts, Mesh
from facade_core.geometry.ground.kerb_objects import resolve_kerb_objects
from facade_core.geometry.ground.layers import join_carriageways, join_driven_lanes
from facade_core.geometry.ground.settings import KERBS, OBJECTS

# Numbers in [0, 1) by the id of an object: its variant, size and heading.
_RANDOM_NUMBERS = 3


@dataclass(frozen=True, slots=True)
class _Candidate:
    """Object before it is known whether there is room for it; `size` in metres, `heading` in degrees."""

    id: str
    kind: ObjectKind
    x: float
    y: float
    heading: float
    size: tuple[float, float, float]
    is_stated: bool = True

    def standing_area(self) -> Polygon:
        """Return the ground under it: its foot, or the rectangle of a low object."""
        if self.kind.is_overhanging:
            return Point(self.x, self.y).buffer(self.kind.foot_m, quad_segs=4)
        corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]) * self.size[:2]
        return Polygon(corners @ heading_axes(np.array([self.heading]))[0, :2, :2] + (self.x, self.y))


def place_objects(
    ground: MappedGround,
    footprints: Sequence[Polygon | MultiPolygon],
    charts: Charts,
    mesh: Mesh,
    is_shown: BoolArray,
) -> PlacedObjects:
    """Place the objects of a block that there is room for.

    Objects in a wall or on a carriageway are moved to its edge, or left out where that is too far. Those that no map
    states stand clear of the others, and of walls as far as doors need it. Crowns of trees are narrowed to the gap
    between walls.

    Parameters
    ----------
    ground : ground, fitted between the buildings.
    footprints : outlines of the buildings.
    charts, mesh : surfaces of the block.
    is_shown : (charts,) True where ground carries objects.
    """
    if not ground.objects:
        return NO_OBJECTS
    surface = _GroundSurface(charts, mesh, is_shown)
    free = _FreeGround(ground.ways, footprints)
    lines = np.array([way.line for way in ground.ways if way.kind != "crossing"], object)
    ways = shapely.STRtree(lines)
    found: list[_Candidate] = []
    heights: list[float] = []
    taken = shapely.STRtree([])
    for is_stated, some in groupby(resolve_kerb_objects(ground), lambda one: one.is_stated):
        if not is_stated:
            taken = shapely.STRtree([one.standing_area() for one in found if not one.kind.is_overhead])
        for candidate in (one for stated in some for one in _candidates(stated, ways)):
            fitted = free.fit(candidate)
            height = None if fitted is None else surface.height_below(fitted.x, fitted.y)
            if fitted is None or height is None or len(taken.query(fitted.standing_area(), predicate="intersects")):
                continue
            found.append(fitted)
            heights.append(height)
    if not found:
        return NO_OBJECTS
    return PlacedObjects(
        tuple(one.id for one in found),
        np.array([OBJECT_KIND_NAMES.index(one.kind.name) for one in found], np.int32),
        np.array([int(random_numbers(one.id)[0] * one.kind.variants) for one in found], np.int32),
        np.array([(one.x, one.y, z) for one, z in zip(found, heights, strict=True)]),
        np.array([one.heading for one in found]),
        np.array([one.size for one in found]),
        np.array([one.is_stated for one in found]),
    )


def random_numbers(id: str) -> tuple[float, ...]:
    """Return numbers in [0, 1) by the id of an object."""
    return tuple(np.random.default_rng(hash_name(id)).random(_RANDOM_NUMBERS).tolist())


def standing_areas(placed: PlacedObjects) -> list[Polygon]:
    """Return the ground that placed objects stand on."""
    return [
        _Candidate(id, object_kind(OBJECT_KIND_NAMES[kind]), x, y, heading, (size[0], size[1], size[2])).standing_area()
        for id, kind, (x, y, _), heading, size in zip(
            placed.id,
            placed.kind.tolist(),
            placed.position.tolist(),
            placed.heading.tolist(),
            placed.size.tolist(),
            strict=True,
        )
    ]


class _FreeGround:
    """Ground between walls, carriageways and tracks of trams."""

    def __init__(self, ways: Sequence[GroundWay], footprints: Sequence[Polygon | MultiPolygon]) -> None:
        carriageway, _ = join_carriageways([way for way in ways if way.kind == "road"])
        tracks = [way.line.buffer(way.width / 2) for way in ways if way.kind == "tram"]
        self._parts = np.array([*footprints, *shapely.get_parts(carriageway), *tracks], object)
        self._tree = shapely.STRtree(self._parts)
        self._walls = shapely.STRtree(list(footprints))
        lanes = join_driven_lanes([way for way in ways if way.kind == "road"])
        self._lanes = shapely.STRtree([*footprints, *shapely.get_parts(lanes), *tracks])

    def fit(self, candidate: _Candidate) -> _Candidate | None:
        """Return an object where there is room for it, and as wide as there is; None without."""
        if candidate.is_stated and not candidate.kind.is_joined:
            candidate = self._move_clear(candidate)
        area = candidate.standing_area()
        if len(self._obstacles(candidate).query(area, predicate="intersects")):
            return None
        if not candidate.is_stated and len(self._walls.query(area, "dwithin", KERBS.door_clearance_m)):
            return None
        if candidate.kind.facing is not Facing.ANYWHERE:
            return candidate
        width, depth, height = candidate.size
        _, gap = self._walls.query_nearest(
            Point(candidate.x, candidate.y), max_distance=width, return_distance=True, all_matches=False
        )
        crown = min(width, 2 * (float(gap[0]) - OBJECTS.crown_gap_m)) if len(gap) else width
        if crown < OBJECTS.min_crown_m:
            return None
        return replace(candidate, size=(crown, crown * depth / width, height))

    def _obstacles(self, candidate: _Candidate) -> shapely.STRtree:
        """Return the obstacles that an object keeps off: walls and roadways, or lanes for a parked car."""
        if candidate.kind.is_overhead:
            return self._walls
        is_parked = candidate.kind.name == "parked_car" and not candidate.is_stated
        return self._lanes if is_parked else self._tree

    def _move_clear(self, candidate: _Candidate) -> _Candidate:
        """Return an object moved out of the obstacle that it stands in, or too near to."""
        place, reach = Point(candidate.x, candidate.y), candidate.kind.foot_m + 0.02
        near = self._tree.query(place, predicate="dwithin", distance=reach)
        if not len(near):
            return candidate
        obstacle = shapely.union_all(self._parts[np.sort(near)])
        edge = np.array(shapely.get_coordinates(shapely.shortest_line(obstacle.boundary, place)))[0]
        away = np.array([place.x, place.y]) - edge
        distance = float(np.hypot(*away))
        is_inside = obstacle.contains(place)
        if distance < 1e-6 or (is_inside and distance > OBJECTS.max_shift_m):
            return candidate
        x, y = edge + away / distance * (-reach if is_inside else reach)
        return replace(candidate, x=float(x), y=float(y))


class _GroundSurface:
    """Triangles of the ground that carry objects."""

    def __init__(self, charts: Charts, mesh: Mesh, is_shown: BoolArray) -> None:
        is_ground = (charts.kind == ChartKind.GROUND) & is_shown
        self._corners = mesh.vertices[mesh.triangles[is_ground[mesh.chart]]]
        self._tree = shapely.STRtree(shapely.polygons(self._corners[..., :2]))

    def height_below(self, x: float, y: float) -> float | None:
        """Return the height of the ground at a place; None where there is none."""
        rows = self._tree.query(Point(x, y), predicate="intersects")
        if not len(rows):
            return None
        a, b, c = self._corners[int(rows.min())]
        u, v = np.linalg.solve(np.column_stack([b - a, c - a])[:2], np.array([x, y]) - a[:2])
        return float(a[2] + u * (b - a)[2] + v * (c - a)[2])


def _candidates(stated: GroundObject, ways: shapely.STRtree) -> Iterator[_Candidate]:
    """Yield the objects of a mapped feature."""
    kind, geometry = object_kind(stated.kind), stated.geometry
    if geometry.geom_type == "LineString" and kind.spacing_m:
        yield from _objects_along(stated, kind, geometry)
        return
    if "Polygon" in geometry.geom_type:
        yield _object_of_outline(stated, kind, geometry)
        return
    place = geometry if geometry.geom_type == "Point" else geometry.interpolate(0.5, normalized=True)
    heading = stated.direction
    if heading is None:
        heading = 360 * random_numbers(stated.id)[2]
        if kind.facing is Facing.WAY and len(ways.geometries):
            heading = _heading_to_way(place, ways)
    yield _Candidate(stated.id, kind, place.x, place.y, heading, _object_size(stated, kind), stated.is_stated)


def _objects_along(stated: GroundObject, kind: ObjectKind, line: LineString) -> Iterator[_Candidate]:
    """Yield objects along a line, at its spacing; joined ones between the corners of the line."""
    if not kind.is_joined:
        count = max(1, int(line.length / kind.spacing_m) + 1)
        for number, along in enumerate(np.linspace(0, line.length, count)):
            place, id = line.interpolate(along), f"{stated.id}-{number}"
            heading = 360 * random_numbers(id)[2]
            yield _Candidate(id, kind, place.x, place.y, heading, _object_size(replace(stated, id=id), kind))
        return
    number = 0
    points = np.asarray(line.coords)[:, :2]
    for a, b in zip(points[:-1], points[1:], strict=True):
        length = float(np.hypot(*(b - a)))
        count = max(1, round(length / kind.spacing_m))
        heading = float(np.degrees(np.arctan2(-(b - a)[1], (b - a)[0])) % 360)
        for x, y in a + (b - a) * ((np.arange(count) + 0.5) / count)[:, None]:
            if length > 0:
                _, depth, height = _object_size(stated, kind)
                yield _Candidate(f"{stated.id}-{number}", kind, x, y, heading, (length / count, depth, height))
                number += 1


def _object_of_outline(stated: GroundObject, kind: ObjectKind, outline: Polygon) -> _Candidate:
    """Return the object in the middle of an outline, along its sides."""
    corners = np.asarray(shapely.minimum_rotated_rectangle(outline).exterior.coords)
    side, other = corners[1] - corners[0], corners[2] - corners[1]
    is_long = kind.size[0] > kind.size[1]
    ahead = side if (np.hypot(*side) < np.hypot(*other)) == is_long else other
    heading = float(np.degrees(np.arctan2(*ahead)) % 360) + 180 * (random_numbers(stated.id)[2] < 0.5)
    place = outline.centroid
    return _Candidate(stated.id, kind, place.x, place.y, heading % 360, _object_size(stated, kind))


def _heading_to_way(place: Point, ways: shapely.STRtree) -> float:
    nearest = ways.geometries[ways.nearest(place)]
    (x0, y0), (x1, y1) = shapely.get_coordinates(shapely.shortest_line(place, nearest))
    return float(np.degrees(np.arctan2(x1 - x0, y1 - y0)) % 360)


def _object_size(stated: GroundObject, kind: ObjectKind) -> tuple[float, float, float]:
    """Return the size of an object: as stated, else the usual one varied by its id."""
    length, depth, usual = kind.size
    low, high = OBJECTS.size_factors
    tall = 1 + kind.spread * (2 * random_numbers(stated.id)[1] - 1)
    if stated.height:
        tall = float(np.clip(stated.height / usual, low, high))
    if kind.facing is Facing.ANYWHERE:
        wide = float(np.clip(stated.width / length, low, high)) if stated.width else tall
        return length * wide, depth * wide, usual * tall
    if kind.is_joined and stated.width:
        depth *= float(np.clip(stated.width / depth, low, high))
    return length, depth, usual * tall
