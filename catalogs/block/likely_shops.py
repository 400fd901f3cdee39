"""Likely shops on roads whose class suggests them, where the map has none."""

from __future__ import annotations

from collections.abc import Sequence
from hashlib import blake2b

import numpy as np
import shapely

from facade_core.core.types import Building, GroundWay

# Rank of a road (tertiary, secondary, primary) -> share of its buildings with a shop.
SHOP_SHARE_BY_RANK = {5: 0.2, 6: 0.3, 7: 0.35}
# Distance of a building with a shop from the carriageway's edge.
MAX_SETBACK_M = 8.0
MIN_SHOP_AREA_M2 = 80.0
MIN_SHOP_HEIGHT_M = 5.0
# Distance of a mapped shop from its building.
MAX_SHOP_DISTANCE_M = 15.0
# The front is the longest edge among those at most this much farther from the road than the nearest edge.
FRONT_TOLERANCE_M = 3.0


def likely_shop_positions(
    buildings: Sequence[Building], ways: Sequence[GroundWay], places: Sequence[tuple[float, float]]
) -> list[tuple[float, float]]:
    """Return the (x, y) of shops on the fronts of buildings that are likely to have one.

    The choice depends only on the building, the road nearest to it, and whether a mapped shop is its own.

    Parameters
    ----------
    places : (x, y) of mapped shops in the frame.

    Returns
    -------
    (x, y) of the middle of the front of each chosen building.
    """
    roads = [way for way in ways if way.kind == "road"]
    if not roads or not buildings:
        return []
    footprints = [building.footprint for building in buildings]
    has = np.zeros(len(buildings), bool)
    if len(places):
        points = shapely.points(np.array(places).reshape(-1, 2))
        has[shapely.STRtree(footprints).query_nearest(points, max_distance=MAX_SHOP_DISTANCE_M)[1]] = True
    houses = {building.whole_id for building, one in zip(buildings, has, strict=True) if one}
    _, road = shapely.STRtree([way.line for way in roads]).query_nearest(footprints, all_matches=False)
    found = []
    for building, nearest in zip(buildings, road.tolist(), strict=True):
        way = roads[nearest]
        low = building.raised > 0 or building.height < MIN_SHOP_HEIGHT_M or building.footprint.area < MIN_SHOP_AREA_M2
        if (
            low
            or building.whole_id in houses
            or _hash_fraction(building.whole_id) >= SHOP_SHARE_BY_RANK.get(way.rank, 0.0)
        ):
            continue
        front = _front_midpoint(building, way)
        if front is not None:
            found.append(front)
    return found


def _front_midpoint(building: Building, way: GroundWay) -> tuple[float, float] | None:
    """Return the middle of a building's front on a road, or None if the building is set back."""
    rings = [np.asarray(part.exterior.coords)[:, :2] for part in shapely.get_parts(building.footprint).tolist()]
    ends = np.concatenate([np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings])
    middles = ends.mean(axis=1)
    away = shapely.distance(shapely.points(middles), way.line)
    if shapely.distance(building.footprint, way.line) > way.width / 2 + MAX_SETBACK_M:
        return None
    length = np.where(away <= away.min() + FRONT_TOLERANCE_M, np.hypot(*(ends[:, 1] - ends[:, 0]).T), 0.0)
    x, y = middles[int(length.argmax())].tolist()
    return x, y


def _hash_fraction(id: str) -> float:
    """Return a number from 0 to 1 that depends only on the id."""
    digest = blake2b(id.encode(errors="surrogatepass"), digest_size=4, person=b"shop").digest()
    return int.from_bytes(digest, "big") / 2**32
