"""Neighbours of buildings, and the common ground height of building parts."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from facade_core.core.types import Building
from facade_core.geometry.buildings.roof_edges import OPEN_SURROUNDINGS
from facade_core.geometry.buildings.settings import EAVES, NEIGHBOURS, ROOF_EDGES
from facade_core.geometry.ground.terrain import Terrain


def roof_continuation_footprints(
    index: int, buildings: Sequence[Building], tree: shapely.STRtree
) -> list[Polygon | MultiPolygon]:
    """Return the adjoining footprints over which a building's roof continues; none for a part.

    Parameters
    ----------
    index : row of the building.
    tree : footprints of all buildings.
    """
    own = buildings[index]
    if own.roof is None or not own.roof.height > 0 or own.part_of is not None:
        return []
    near = sorted(tree.query(own.footprint, predicate="dwithin", distance=NEIGHBOURS.neighbour_gap_m).tolist())
    others = [buildings[i] for i in near if i != index]
    return [
        other.footprint
        for other in others
        if other.height >= NEIGHBOURS.min_height_ratio * own.height and other.footprint.is_valid
    ]


def neighbour_area_above_eaves(
    index: int, buildings: Sequence[Building], tree: shapely.STRtree, terrain: Terrain
) -> BaseGeometry:
    """Return the area covered by neighbours that reach up to a building's eaves.

    Parameters
    ----------
    index : row of the building.
    tree : footprints of all buildings.
    """
    own = buildings[index]
    if own.shell is not None or not np.isfinite(own.height):
        return OPEN_SURROUNDINGS.neighbours
    least = _base_height(own, terrain) + own.height - NEIGHBOURS.eaves_tolerance_m
    near = [
        i
        for i in tree.query(
            own.footprint, predicate="dwithin", distance=EAVES.overhang_m + ROOF_EDGES.neighbour_clearance_m
        )
        if i != index
    ]
    high = [
        one
        for one in (buildings[i] for i in sorted(near))
        if one.footprint.is_valid and _top_height(one, terrain) > least
    ]
    # a part of the same building on the roof's edge counts as adjoining
    return shapely.union_all(
        [
            one.footprint.buffer(ROOF_EDGES.neighbour_clearance_m, join_style="mitre")
            if one.whole_id == own.whole_id
            else one.footprint
            for one in high
        ]
    )


def _base_height(building: Building, terrain: Terrain) -> float:
    return terrain.lowest_along(building.footprint) if building.base is None else building.base


def _top_height(building: Building, terrain: Terrain) -> float:
    return _base_height(building, terrain) + building.height + (building.roof.height if building.roof else 0.0)


def outline_without_party_walls(index: int, buildings: Sequence[Building], tree: shapely.STRtree) -> shapely.Geometry:
    """Return the outline of a building without the part shared with neighbours; models often omit party walls.

    Parameters
    ----------
    index : row of the building.
    tree : footprints of all buildings.
    """
    footprint = buildings[index].footprint
    others = [i for i in tree.query(footprint, predicate="dwithin", distance=NEIGHBOURS.neighbour_gap_m) if i != index]
    touched = shapely.union_all([buildings[i].footprint for i in others]).buffer(NEIGHBOURS.neighbour_gap_m)
    return shapely.difference(footprint.boundary, touched)


def unify_building_part_bases(buildings: Sequence[Building], terrain: Terrain) -> list[Building]:
    """Set the base of all parts of a building to the lowest ground height along any of them."""
    parts: dict[str, list[Building]] = defaultdict(list)
    for building in buildings:
        if building.part_of is not None:
            parts[building.part_of].append(building)
    for building in buildings if parts else ():
        if building.id in parts:
            parts[building.id].append(building)
    ground = {whole: min(_base_height(part, terrain) for part in own) for whole, own in parts.items()}
    lowest = [ground.get(building.part_of or building.id) for building in buildings]
    return [
        building if base is None else replace(building, base=base)
        for building, base in zip(buildings, lowest, strict=True)
    ]
