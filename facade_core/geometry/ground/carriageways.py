"""What ways leave between buildings: carriageways no wider than the gap, and yards where no street comes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from hashlib import blake2b

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from facade_core.core.types import Area, Ground, Street, Way

# What a street is where nothing is known but its line: carriageway and pavements, metres.
ROAD_M, PAVEMENT_M = 7.0, 5.0
# A carriageway keeps this far from the buildings beside it, and is at least so wide; metres.
FRONT_M, NARROWEST_M = 1.4, 2.6
# Pavements reach buildings that are no further from the kerb; how far is looked for any.
FRONTED_M, FAR_M = 9.0, 30.0
# From one place that is measured along a way to the next.
STEP_M = 4.0
# A yard is ground between buildings that are no further apart, and at least this large: metres and square metres.
YARD_M, YARD_M2 = 24.0, 12.0


def ways_of(streets: Sequence[Street]) -> tuple[Way, ...]:
    """Streets of which only the lines are known, as ways: assumed carriageways with pavements."""
    return tuple(
        Way(street.id, street.line, "road", ROAD_M, "asphalt", pavement=(PAVEMENT_M, PAVEMENT_M)) for street in streets
    )


def fitted(ground: Ground, streets: Sequence[Street], footprints: Sequence[Polygon | MultiPolygon]) -> Ground:
    """The ground of a block among its buildings: no carriageway is wider than they leave, and what they enclose is a yard."""
    ways = ground.ways if any(way.kind == "road" for way in ground.ways) else (*ground.ways, *ways_of(streets))
    tree = shapely.STRtree(footprints)
    ways = tuple(_narrowed(way, tree) for way in ways)
    return replace(ground, ways=ways, areas=tuple(_apart([*_yards(ways, footprints), *ground.areas])))


def _narrowed(way: Way, tree: shapely.STRtree) -> Way:
    """A way that fits between the buildings beside it; its pavements reach them where they are near."""
    if way.kind not in ("road", "path", "cycle") or way.line.length == 0 or not len(tree):
        return way
    places = shapely.line_interpolate_point(way.line, np.arange(0.0, way.line.length, STEP_M))
    (place, _), away = tree.query_nearest(places, max_distance=FAR_M, return_distance=True, all_matches=False)
    free = np.full(len(places), FAR_M)
    free[place] = away
    free = free[free > 0.3]  # a way through a building says nothing of how wide it is outside
    if not len(free):
        return way
    widest = 2 * (float(np.quantile(free, 0.15)) - (FRONT_M if way.kind == "road" else 0.1))
    if widest < way.width:
        width = round(max(widest, min(NARROWEST_M, way.width)), 2)
        parking = way.parking if width - sum(way.parking) >= 2.2 else (0.0, 0.0)
        way = replace(way, width=width, assumed=True, parking=parking)
    beside = float(np.quantile(free, 0.7)) - way.width / 2
    if way.kind == "road" and beside < FRONTED_M:
        left, right = (max(wide, round(beside + 1.0, 2)) if wide > 0 else 0.0 for wide in way.pavement)
        way = replace(way, pavement=(left, right))
    return way


def _yards(ways: Sequence[Way], footprints: Sequence[Polygon | MultiPolygon]) -> list[Area]:
    """Ground that buildings enclose, or that lies between them beyond the pavements, by its size paved or not."""
    built = shapely.union_all(footprints)
    closed = built.buffer(YARD_M / 2, join_style="mitre").buffer(-YARD_M / 2, join_style="mitre")
    holes = [Polygon(ring) for part in shapely.get_parts(closed) for ring in getattr(part, "interiors", ())]
    streets = [
        way.line.buffer(way.width / 2 + max(way.pavement), cap_style="flat") for way in ways if way.kind == "road"
    ]
    open_ground = shapely.union_all([closed, *holes]).difference(shapely.union_all([built, *streets]))
    yards = []
    for part in shapely.get_parts(open_ground.buffer(-0.2).buffer(0.2)):
        if part.geom_type != "Polygon" or part.area < YARD_M2:
            continue
        place = part.representative_point()
        chance = blake2b(f"{place.x:.0f} {place.y:.0f}".encode(), digest_size=1).digest()[0] / 256
        kinds = ("slabs", "asphalt", "gravel", "gravel") if part.area > 150 else ("slabs", "slabs", "asphalt", "gravel")
        yards.append(Area(f"yard-{place.x:.0f}-{place.y:.0f}", part.buffer(0.3), kinds[int(4 * chance)]))
    return yards


def _apart(areas: Sequence[Area]) -> list[Area]:
    """The areas without what smaller ones of another surface have of them, and yards without any other."""
    shapes = [area.outline for area in areas]
    yard = [area.id.startswith("yard-") for area in areas]
    tree = shapely.STRtree(shapes)
    cut = []
    for index, area in enumerate(areas):
        above = [
            shapes[other]
            for other in np.sort(tree.query(area.outline, predicate="intersects")).tolist()
            if (yard[index], shapes[index].area, area.id) > (yard[other], shapes[other].area, areas[other].id)
            and areas[other].surface != area.surface
        ]
        left = shapely.difference(area.outline, shapely.union_all(above)) if above else area.outline
        parts = [part for part in shapely.get_parts(left) if part.geom_type == "Polygon" and part.area > 0]
        if parts:
            cut.append(replace(area, outline=shapely.multipolygons(parts)))
    return cut
