"""Plausible objects along the kerbs of roads: lamps of lit roads, and parked cars."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
import shapely
from shapely import Point

from facade_core.core.name_hash import hash_name
from facade_core.core.street_objects import object_kind
from facade_core.core.types import GroundObject, GroundWay, MappedGround
from facade_core.geometry.ground.layers import join_carriageways
from facade_core.geometry.ground.marks import clear_of_marks, parking_places
from facade_core.geometry.ground.settings import KERBS


def resolve_kerb_objects(ground: MappedGround) -> list[GroundObject]:
    """Return the stated objects of the ground, then one for each place of those that roads have in all likelihood.

    Parameters
    ----------
    ground : mapped ground, fitted between the buildings.
    """
    stated = [one for one in ground.objects if one.is_stated]
    if len(stated) == len(ground.objects):
        return stated
    roads = [way for way in ground.ways if way.kind == "road"]
    by_line = {(way.id, way.line.wkb): way for way in roads}
    carriageway, junctions = join_carriageways(roads)
    clear = clear_of_marks(ground.ways, junctions)
    taken = shapely.union_all([carriageway, clear])
    shapely.prepare([clear, taken])
    lamps = [one.geometry.centroid for one in stated if one.kind == "street_lamp"]
    found = list(stated)
    for likely in ground.objects:
        way = by_line.get((likely.id, likely.geometry.wkb))
        if likely.is_stated or way is None:
            continue
        if likely.kind == "street_lamp":
            lit = list(_lamps_along(way, likely, taken, lamps))
            lamps += [one.geometry for one in lit]
            found += lit
        else:
            found += _parked_cars(way, likely, clear)
    return found


def _lamps_along(
    way: GroundWay, likely: GroundObject, taken: shapely.Geometry, lamps: Iterable[Point]
) -> Iterator[GroundObject]:
    """Yield lamps behind the kerb of one side of a road, away from junctions and other lamps."""
    shares = np.random.default_rng(hash_name(way.id)).random(2)
    left, right = way.pavement
    side = 1.0 if left > 0 and (right == 0 or shares[0] < 0.5) else -1.0
    if max(left, right) == 0:
        return
    kerb = shapely.offset_curve(way.line, side * (way.width / 2 + KERBS.lamp_offset_m), join_style="mitre")
    known = shapely.multipoints(list(lamps))
    places = np.arange(shares[1] * KERBS.lamp_spacing_m, kerb.length, KERBS.lamp_spacing_m)
    for number, place in enumerate(shapely.line_interpolate_point(shapely.line_merge(kerb), places)):
        if place.distance(known) < KERBS.lamp_spacing_m or taken.contains(place):
            continue
        (x, y), (x1, y1) = shapely.get_coordinates(shapely.shortest_line(place, way.line))
        heading = float(np.degrees(np.arctan2(x1 - x, y1 - y)) % 360)
        yield replace(likely, id=f"{way.id}-lamp-{number}", geometry=place, direction=heading)


def _parked_cars(way: GroundWay, likely: GroundObject, clear: shapely.Geometry) -> Iterator[GroundObject]:
    """Yield cars on most of a road's places for parking along the kerb, which is on their right."""
    width = object_kind(likely.kind).size[0]
    for number, place in enumerate(parking_places(way, clear)):
        id = f"{way.id}-car-{number}"
        is_parallel = width <= place.depth < 2 * width
        if is_parallel and place.is_whole and np.random.default_rng(hash_name(id)).random() < KERBS.parked_share:
            heading = float(np.degrees(np.arctan2(-place.outward[1], place.outward[0])) % 360)
            yield replace(likely, id=id, geometry=Point(place.middle), direction=heading)
