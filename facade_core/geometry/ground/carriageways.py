"""Fitting of mapped ways between buildings, and yards where no street is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from hashlib import blake2b

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from facade_core.core.types import GroundArea, GroundWay, MappedGround, Street
from facade_core.geometry.ground.settings import CARRIAGEWAYS
from facade_core.geometry.growth import grow_union


def assume_street_ways(streets: Sequence[Street]) -> tuple[GroundWay, ...]:
    """Return road ways of assumed width with pavements, one along each street centreline."""
    return tuple(
        GroundWay(
            street.id,
            street.line,
            "road",
            CARRIAGEWAYS.assumed_road_m,
            "asphalt",
            pavement=(CARRIAGEWAYS.assumed_pavement_m, CARRIAGEWAYS.assumed_pavement_m),
        )
        for street in streets
    )


def fit_ground_between_buildings(
    ground: MappedGround, streets: Sequence[Street], footprints: Sequence[Polygon | MultiPolygon]
) -> MappedGround:
    """Fit the ground of a block among its buildings: narrow the ways to the gaps, and add enclosed yards.

    Parameters
    ----------
    ground : mapped ground.
    streets : streets to use where no road is mapped.
    footprints : outlines of the buildings.
    """
    ways = (
        ground.ways if any(way.kind == "road" for way in ground.ways) else (*ground.ways, *assume_street_ways(streets))
    )
    tree = shapely.STRtree(footprints)
    ways = tuple(_narrow_way(way, tree) for way in ways)
    return replace(ground, ways=ways, areas=tuple(_separate_areas([*_find_yards(ways, footprints), *ground.areas])))


def _narrow_way(way: GroundWay, tree: shapely.STRtree) -> GroundWay:
    """Narrow a way to the gap between buildings, and extend its pavements to near ones."""
    if way.kind not in ("road", "path", "cycle") or way.line.length == 0 or not len(tree):
        return way
    places = shapely.line_interpolate_point(way.line, np.arange(0.0, way.line.length, CARRIAGEWAYS.gap_sampling_m))
    (place, _), away = tree.query_nearest(
        places, max_distance=CARRIAGEWAYS.building_search_m, return_distance=True, all_matches=False
    )
    free = np.full(len(places), CARRIAGEWAYS.building_search_m)
    free[place] = away
    free = free[free > 0.3]  # where a way passes through a building, the gap is unknown
    if not len(free):
        return way
    widest = 2 * (float(np.quantile(free, 0.15)) - (CARRIAGEWAYS.building_clearance_m if way.kind == "road" else 0.1))
    if widest < way.width:
        width = round(max(widest, min(CARRIAGEWAYS.min_carriageway_m, way.width)), 2)
        parking = way.parking if width - sum(way.parking) >= 2.2 else (0.0, 0.0)
        way = replace(way, width=width, assumed=True, parking=parking)
    kerb_gap = float(np.quantile(free, 0.7)) - way.width / 2
    if way.kind == "road" and kerb_gap < CARRIAGEWAYS.max_pavement_m:
        left, right = (max(wide, round(kerb_gap + 1.0, 2)) if wide > 0 else 0.0 for wide in way.pavement)
        way = replace(way, pavement=(left, right))
    return way


def _find_yards(ways: Sequence[GroundWay], footprints: Sequence[Polygon | MultiPolygon]) -> list[GroundArea]:
    """Return the ground that buildings enclose beyond the pavements, with a surface by its size and place."""
    built = shapely.union_all(footprints)
    closed = grow_union(built, footprints, CARRIAGEWAYS.max_yard_gap_m / 2, "mitre").buffer(
        -CARRIAGEWAYS.max_yard_gap_m / 2, join_style="mitre"
    )
    holes = [Polygon(ring) for part in shapely.get_parts(closed) for ring in getattr(part, "interiors", ())]
    streets = [
        way.line.buffer(way.width / 2 + max(way.pavement), cap_style="flat") for way in ways if way.kind == "road"
    ]
    open_ground = shapely.union_all([closed, *holes]).difference(shapely.union_all([built, *streets]))
    yards = []
    for part in shapely.get_parts(open_ground.buffer(-0.2).buffer(0.2)):
        if part.geom_type != "Polygon" or part.area < CARRIAGEWAYS.min_yard_m2:
            continue
        place = part.representative_point()
        chance = blake2b(f"{place.x:.0f} {place.y:.0f}".encode(), digest_size=1).digest()[0] / 256
        kinds = ("slabs", "asphalt", "gravel", "gravel") if part.area > 150 else ("slabs", "slabs", "asphalt", "gravel")
        yards.append(GroundArea(f"yard-{place.x:.0f}-{place.y:.0f}", part.buffer(0.3), kinds[int(4 * chance)]))
    return yards


def _separate_areas(areas: Sequence[GroundArea]) -> list[GroundArea]:
    """Cut smaller areas of other surfaces out of larger ones, and all areas out of yards."""
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
