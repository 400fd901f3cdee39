"""Heights of buildings that state none.

The floor count is the weighted median of neighbours of similar area, varied by one floor by the hash of the id.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import shapely

from catalogs.buildings.roofs import SHED_USES, hash_uniform_pair
from catalogs.buildings.settings import HEIGHTS, ROOFS
from catalogs.features import Footprint
from facade_core.core.arrays import BoolArray, Float64Array, ObjectArray
from facade_core.core.types import Building

ONE_FLOOR_USES = SHED_USES | {"kiosk", "pavilion", "greenhouse", "glasshouse", "toilets", "bungalow", "farm_auxiliary"}


class KnownFloors(NamedTuple):
    """Buildings with known heights.

    Attributes
    ----------
    centre : (k, 2) centroids, metres.
    area : (k,) m2.
    levels : (k,) floors, also in parts of one.
    """

    centre: Float64Array
    area: Float64Array
    levels: Float64Array


def assume_heights(
    buildings: Sequence[Building], footprints: Sequence[Footprint | None], floor_height: float
) -> tuple[Building, ...]:
    """Assume a height for buildings of height_source "default".

    Parameters
    ----------
    buildings : n buildings; known heights reach to the eaves.
    footprints : (n,) footprint that each building comes from, or None.
    floor_height : metres.
    """
    unknown = np.array([building.height_source == "default" for building in buildings], bool)
    if not unknown.any():
        return tuple(buildings)
    outlines = np.array([building.footprint for building in buildings], dtype=object)
    area, centre = shapely.area(outlines), shapely.get_coordinates(shapely.centroid(outlines))
    low = _is_single_floor(outlines, area, footprints)
    # the height of a model reaches to its top, so it gives no floor count
    known = ~unknown & ~low & np.array([building.shell is None for building in buildings], bool)
    levels = np.array([building.height / floor_height for building in buildings])
    chance = np.array([hash_uniform_pair(building.id)[0] for building in buildings])
    likely = np.ones(len(buildings))
    asked = unknown & ~low
    likely[asked] = _estimate_floors(
        centre[asked],
        area[asked],
        chance[asked],
        KnownFloors(centre[known], area[known], levels[known]),
        HEIGHTS.fallback_height_m / floor_height,
    )
    return tuple(
        replace(building, height=round(float(count) * floor_height, 2)) if assumed else building
        for building, count, assumed in zip(buildings, likely, unknown, strict=True)
    )


def _is_single_floor(outlines: ObjectArray, area: Float64Array, stated: Sequence[Footprint | None]) -> BoolArray:
    """Return a mask (n,) of the buildings that have one floor by use or size."""
    low: BoolArray = (area < HEIGHTS.max_low_area_m2) | np.array(
        [source is not None and source.use in ONE_FLOOR_USES for source in stated], bool
    )
    small = np.flatnonzero(~low & (area < HEIGHTS.max_detached_low_area_m2))
    near, _ = shapely.STRtree(outlines).query(outlines[small], predicate="dwithin", distance=ROOFS.attached_distance_m)
    low[small[np.bincount(near, minlength=len(small)) <= 1]] = True  # each building is its own neighbour
    return low


def _estimate_floors(
    centre: Float64Array,
    area: Float64Array,
    chance: Float64Array,
    known: KnownFloors,
    default_floors: float,
) -> Float64Array:
    """Return whole floor counts (n,): the weighted median of the known ones, varied by `chance`.

    Parameters
    ----------
    centre : (n, 2) centroids, metres.
    area : (n,) m2.
    chance : (n,) from 0 to 1.
    known : buildings with known heights.
    default_floors : count where no height is known.
    """
    from scipy.spatial import cKDTree

    step = (chance > 1 - HEIGHTS.variation_share).astype(int) - (chance < HEIGHTS.variation_share).astype(int)
    if not len(known.levels) or not len(centre):
        assumed: Float64Array = np.maximum(1.0, np.round(default_floors) + step)
        return assumed
    distance, index = cKDTree(known.centre).query(centre, k=min(HEIGHTS.max_neighbours, len(known.levels)))
    distance, index = distance.reshape(len(centre), -1), index.reshape(len(centre), -1)
    unlike = np.log(known.area[index] / area[:, None])
    weight = (np.exp(-distance / HEIGHTS.distance_scale_m) + HEIGHTS.far_weight) * np.maximum(
        np.exp(-0.5 * (unlike / HEIGHTS.log_area_scale) ** 2), 1e-6
    )
    order = np.argsort(known.levels[index], axis=1, kind="stable")
    levels = np.take_along_axis(known.levels[index], order, axis=1)
    share = np.cumsum(np.take_along_axis(weight, order, axis=1), axis=1)
    middle = np.argmax(share >= 0.5 * share[:, -1:], axis=1)
    floors: Float64Array = np.maximum(1.0, np.round(np.take_along_axis(levels, middle[:, None], axis=1)[:, 0]) + step)
    return floors
