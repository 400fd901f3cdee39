"""Passages of streets through extruded buildings: openings of walls, side walls and ceilings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from facade_core.core.arrays import Float64Array
from facade_core.core.fixed_order import dot_product
from facade_core.core.types import MIN_PASSAGE_HEIGHT_M, MIN_WALL_OVER_PASSAGE_M, Building
from facade_core.geometry.buildings.settings import PASSAGES
from facade_core.geometry.ground.settings import TERRAIN
from facade_core.geometry.ground.terrain import Terrain


class PassageOpening(NamedTuple):
    """Part of a building that is open below a ceiling.

    Attributes
    ----------
    area : polygon within the footprint, counter-clockwise.
    ground : highest ground along its border, metres.
    ceiling : height of the ceiling, metres.
    """

    area: Polygon
    ground: float
    ceiling: float


class WallOpening(NamedTuple):
    """Opening at the foot of a wall.

    Attributes
    ----------
    left, right : metres from the start of the wall.
    top : height of the upper edge, metres.
    """

    left: float
    right: float
    top: float


def passage_openings(
    building: Building, outline: Polygon | MultiPolygon, base: float, terrain: Terrain
) -> list[PassageOpening]:
    """Return the areas of an extruded building that its passages open, apart from each other.

    A ceiling is at least MIN_WALL_OVER_PASSAGE_M below the eaves. Passages that would be lower than
    MIN_PASSAGE_HEIGHT_M stay closed. Of passages that cross the lower ceiling counts.

    Parameters
    ----------
    outline : footprint as it is extruded, counter-clockwise.
    base : ground height of the building in metres.
    """
    found: list[tuple[shapely.Geometry, float, float]] = []
    for passage in building.passages:
        area = shapely.intersection(passage.corridor, outline)
        if area.area < PASSAGES.min_area_m2:
            continue
        border = shapely.get_coordinates(shapely.segmentize(area, TERRAIN.outline_sampling_m))
        ground = max(base, float(terrain.interpolate(border).max()))
        ceiling = min(ground + passage.height, base + building.height - MIN_WALL_OVER_PASSAGE_M)
        ceiling = max(ceiling, base + building.raised) if building.raised else ceiling
        if ceiling - ground >= MIN_PASSAGE_HEIGHT_M - PASSAGES.on_wall_m:
            found.append((area, ground, ceiling))
    openings = []
    for part in shapely.get_parts(shapely.union_all([area for area, _, _ in found])).tolist():
        if part.geom_type != "Polygon" or part.area < PASSAGES.min_area_m2:
            continue
        own = [(ground, ceiling) for area, ground, ceiling in found if area.intersection(part).area > 0]
        openings.append(
            PassageOpening(
                shapely.orient_polygons(part), max(one[0] for one in own), min(ceiling for _, ceiling in own)
            )
        )
    return openings


def wall_openings(start: Float64Array, end: Float64Array, openings: Sequence[PassageOpening]) -> list[WallOpening]:
    """Return the openings of a wall over an edge of a footprint.

    Parameters
    ----------
    start, end : (2,) ends of the edge.
    """
    length = float(np.hypot(*(end - start)))
    if not openings or length < PASSAGES.on_wall_m:
        return []
    edge, along = shapely.LineString([start, end]), (end - start) / length
    found = []
    for opening in openings:
        for a, b in polygon_edges(opening.area):
            if shapely.distance(edge, shapely.points([a, (a + b) / 2, b])).max() < PASSAGES.on_wall_m:
                left, right = (_snap(dot_product(point - start, along), length) for point in (a, b))
                if right - left > PASSAGES.on_wall_m:
                    found.append(WallOpening(left, right, opening.ceiling))
    return found


def passage_sides(outline: Polygon, opening: PassageOpening) -> list[tuple[Float64Array, Float64Array]]:
    """Return the edges (2,), (2,) of the walls inside a passage, with the building on their left."""
    border = outline.boundary
    return [
        (b, a)
        for a, b in polygon_edges(opening.area)
        if shapely.distance(border, shapely.points([a, (a + b) / 2, b])).max() >= PASSAGES.on_wall_m
    ]


def standing_outline(outline: Polygon | MultiPolygon, openings: Sequence[PassageOpening]) -> Polygon | MultiPolygon:
    """Return a footprint without its passages."""
    if not openings:
        return outline
    left = shapely.difference(outline, shapely.union_all([opening.area for opening in openings]))
    parts = [
        part
        for part in shapely.get_parts(left).tolist()
        if part.geom_type == "Polygon" and part.area > PASSAGES.min_area_m2
    ]
    return shapely.orient_polygons(MultiPolygon(parts))


def footprint_without_headroom(building: Building, terrain: Terrain, headroom: float) -> Polygon | MultiPolygon:
    """Return a building's footprint without the passages whose ceilings are `headroom` metres over the ground.

    Parameters
    ----------
    headroom : metres from the ground that a camera needs.
    """
    if not building.passages or not building.footprint.is_valid:
        return building.footprint
    outline = shapely.orient_polygons(building.footprint)
    base = terrain.lowest_along(outline) if building.base is None else building.base
    high = [
        opening
        for opening in passage_openings(building, outline, base, terrain)
        if opening.ceiling - opening.ground >= headroom
    ]
    return standing_outline(outline, high)


def has_closed_passage(building: Building, terrain: Terrain) -> bool:
    """Return whether a passage that crosses a building stays closed, as its ceiling would be too low over the ground."""
    outline = shapely.orient_polygons(building.footprint)
    base = terrain.lowest_along(outline) if building.base is None else building.base
    crossing = [
        one for one in building.passages if shapely.intersection(one.corridor, outline).area >= PASSAGES.min_area_m2
    ]
    return any(not passage_openings(replace(building, passages=(one,)), outline, base, terrain) for one in crossing)


def polygon_edges(area: Polygon | MultiPolygon) -> list[tuple[Float64Array, Float64Array]]:
    """Return the edges of polygons; their inside is on the left."""
    polygons = shapely.get_parts(area).tolist()
    rings = [np.asarray(ring.coords) for part in polygons for ring in (part.exterior, *part.interiors)]
    return [edge for ring in rings for edge in pairwise(ring)]


def _snap(distance: float, length: float) -> float:
    """Return a distance on a wall, at its end where it is next to it."""
    return 0.0 if distance < PASSAGES.on_wall_m else length if length - distance < PASSAGES.on_wall_m else distance
