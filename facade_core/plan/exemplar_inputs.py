"""Inputs for the choice of exemplars from footprints alone, independent of the division of a city into blocks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from facade_core.core.arrays import Float64Array, Int64Array
from facade_core.core.facade_styles import facade_style_number
from facade_core.core.name_hash import hash_name
from facade_core.core.types import Building
from facade_core.plan.exemplar_choice import ExemplarTargetWalls
from facade_core.plan.facades import count_facade_floors
from facade_core.plan.settings import PLANNED_FACADES


def target_walls_from_outlines(
    buildings: Sequence[Building], streets: Sequence[str], shops: Sequence[int], floor_height: float
) -> ExemplarTargetWalls:
    """Return the footprint edges that are wide enough for a facade as target walls.

    Parameters
    ----------
    buildings : buildings of the city.
    streets : name of the nearest street of each building.
    shops : 1, 0 or -1 (unknown) for each building.
    floor_height : floor height in metres where levels are not tagged.
    """
    ends, owner = [], []
    for row, building in enumerate(buildings):
        rings = [part.exterior for part in shapely.get_parts(building.footprint).tolist()]
        edges = np.concatenate([_edges(np.asarray(ring.coords)[:, :2]) for ring in rings])
        width = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)
        kept = (width >= PLANNED_FACADES.min_facade_width_m) | (np.arange(len(width)) == width.argmax())
        ends.append(edges[kept])
        owner.append(np.full(int(kept.sum()), row))
    walls = np.concatenate([np.zeros((0, 2, 2)), *ends])
    of = np.concatenate([np.zeros(0, np.int64), *owner])
    heights = np.array([building.height for building in buildings], float)
    floors = count_facade_floors([building.levels for building in buildings], heights, floor_height)
    return ExemplarTargetWalls(
        np.linalg.norm(walls[:, 1] - walls[:, 0], axis=1),
        heights[of],
        floors[of],
        np.array([hash_name(building.whole_id) for building in buildings], np.int64)[of],
        np.array([hash_name(name) for name in streets], np.int64)[of],
        walls,
        np.array(shops, np.int64)[of],
        facade_style_numbers(buildings)[of],
    )


def facade_style_numbers(buildings: Sequence[Building]) -> Int64Array:
    """Return the numbers of the facade styles of n buildings, (n,)."""
    return np.array([facade_style_number(building.facade_style) for building in buildings], np.int64)


def _edges(ring: Float64Array) -> Float64Array:
    """Return the edges (k, 2, 2) of a closed ring (k + 1, 2)."""
    return np.stack([ring[:-1], ring[1:]], axis=1)
