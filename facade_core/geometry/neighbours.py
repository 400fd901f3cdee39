"""What a building has beside it, and which stand on one ground."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from facade_core.core.types import Building
from facade_core.geometry.buildings.eaves import OVERHANG_M
from facade_core.geometry.buildings.roof_edges import ASIDE_M, OPEN
from facade_core.geometry.ground.terrain import Terrain

# The outline of a model lies this near to its neighbours'.
OUTLINE_M = 0.3
# A roof runs on over neighbours whose walls are at least this share of its own's.
AS_HIGH = 0.5
# A neighbour that ends this much lower is in no eaves' way.
LOWER_M = 0.5


def beside(index: int, buildings: Sequence[Building], tree: shapely.STRtree) -> list[Polygon | MultiPolygon]:
    """The footprints of a building's neighbours that are not much lower, over which its roof runs on: of a part none."""
    own = buildings[index]
    if own.roof is None or not own.roof.height > 0 or own.part_of is not None:
        return []
    near = sorted(tree.query(own.footprint, predicate="dwithin", distance=OUTLINE_M).tolist())
    others = [buildings[i] for i in near if i != index]
    return [other.footprint for other in others if other.height >= AS_HIGH * own.height and other.footprint.is_valid]


def in_the_way(index: int, buildings: Sequence[Building], tree: shapely.STRtree, terrain: Terrain) -> BaseGeometry:
    """What a building's neighbours cover that reach up to its eaves."""
    own = buildings[index]
    if own.shell is not None or not np.isfinite(own.height):
        return OPEN.high
    least = _base(own, terrain) + own.height - LOWER_M
    near = [i for i in tree.query(own.footprint, predicate="dwithin", distance=OVERHANG_M + ASIDE_M) if i != index]
    high = [
        one for one in (buildings[i] for i in sorted(near)) if one.footprint.is_valid and _top(one, terrain) > least
    ]
    # what stands on its own roof's edge counts as beside it
    return shapely.union_all(
        [one.footprint.buffer(ASIDE_M, join_style="mitre") if _of_one(own, one) else one.footprint for one in high]
    )


def _of_one(own: Building, other: Building) -> bool:
    """Whether two are parts of one building, or one of the other."""
    return own.house == other.house


def _base(building: Building, terrain: Terrain) -> float:
    return terrain.lowest(building.footprint) if building.base is None else building.base


def _top(building: Building, terrain: Terrain) -> float:
    return _base(building, terrain) + building.height + (building.roof.height if building.roof else 0.0)


def free_line(index: int, buildings: Sequence[Building], tree: shapely.STRtree) -> shapely.Geometry:
    """The line along which a building's outline is not another's too: party walls are often left out of models."""
    footprint = buildings[index].footprint
    others = [i for i in tree.query(footprint, predicate="dwithin", distance=OUTLINE_M) if i != index]
    touched = shapely.union_all([buildings[i].footprint for i in others]).buffer(OUTLINE_M)
    return shapely.difference(footprint.boundary, touched)


def on_one_ground(buildings: Sequence[Building], terrain: Terrain) -> list[Building]:
    """The buildings, those in parts on the lowest ground along all of these."""
    parts: dict[str, list[Building]] = defaultdict(list)
    for building in buildings:
        if building.part_of is not None:
            parts[building.part_of].append(building)
    for building in buildings if parts else ():
        if building.id in parts:
            parts[building.id].append(building)
    ground = {whole: min(_base(part, terrain) for part in own) for whole, own in parts.items()}
    lowest = [ground.get(building.part_of or building.id) for building in buildings]
    return [
        building if base is None else replace(building, base=base)
        for building, base in zip(buildings, lowest, strict=True)
    ]
