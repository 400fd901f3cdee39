"""Bundles of panoramas for joint refinement, by common walls, limited in number by position."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from facade_core.core.arrays import Float64Array, Int32Array, Int64Array
from facade_core.core.grouping import group_rows

# Panoramas per bundle: their pictures are in memory together, and the equations are dense.
MAX_BUNDLE_SIZE = 12
# Share of a wall that a panorama must show for a comparison.
MIN_WALL_SHARE = 0.25
# Pictures taken more days apart may show two states of a street and are not compared.
MAX_DAYS_APART = 400
# Side in metres of the world's squares that first divide larger groups.
FIRST_SQUARE_M = 4096.0


def group_panoramas_into_bundles(
    wall: Int32Array, panorama: Int32Array, seen: Float64Array, places: Float64Array, days: Sequence[int | None]
) -> list[tuple[int, ...]]:
    """Group panoramas that show the same walls into bundles of two to MAX_BUNDLE_SIZE.

    Two panoramas are connected if both show MIN_WALL_SHARE of one wall and were taken within MAX_DAYS_APART. Connected
    components become bundles. A larger component is divided by squares of the world, whose side is halved until few
    enough panoramas are in each, and connected again there. Thus an added panorama changes the bundle of its square
    only.

    Parameters
    ----------
    wall : (s,) wall of each sighting.
    panorama : (s,) panorama of each sighting.
    seen : (s,) share of the wall that is seen.
    places : (n, 2) east and north of the panoramas in metres.
    days : day number of each panorama, None where unknown.

    Returns
    -------
    Bundles with ascending indices, ordered by their first.
    """
    is_large = seen >= MIN_WALL_SHARE
    pairs = np.array(sorted(_comparable_pairs(wall[is_large], panorama[is_large], days)), np.int64).reshape(-1, 2)
    bundles: list[tuple[int, ...]] = []
    pending = [(group, FIRST_SQUARE_M) for group in _connected_groups(np.arange(len(places)), pairs)]
    while pending:
        group, side = pending.pop()
        if len(group) <= MAX_BUNDLE_SIZE or side < 1e-3:  # cameras at one position are divided by their order
            bundles += [
                tuple(part)
                for i in range(0, len(group), MAX_BUNDLE_SIZE)
                if len(part := group[i : i + MAX_BUNDLE_SIZE].tolist()) > 1
            ]
            continue
        _, square = np.unique(np.floor(places[group] / side), axis=0, return_inverse=True)
        for rows in group_rows(square.reshape(-1)).values():
            pending += [(subgroup, side / 2) for subgroup in _connected_groups(group[rows], pairs)]
    return sorted(bundles)


def _comparable_pairs(wall: Int32Array, panorama: Int32Array, days: Sequence[int | None]) -> set[tuple[int, int]]:
    """Pairs of panoramas that a wall connects, the smaller index first."""
    pairs = set()
    for rows in group_rows(wall).values():
        for one, other in combinations(np.unique(panorama[rows]).tolist(), 2):
            first, second = days[one], days[other]
            if first is None or second is None or abs(first - second) <= MAX_DAYS_APART:
                pairs.add((one, other))
    return pairs


def _connected_groups(members: Int64Array, pairs: Int64Array) -> list[Int64Array]:
    """Return the connected groups of the members, ascending; unconnected ones are left out."""
    local = np.searchsorted(members, pairs[np.isin(pairs, members).all(axis=1)])
    graph = coo_array((np.ones(len(local)), (local[:, 0], local[:, 1])), (len(members), len(members)))
    rows = group_rows(connected_components(graph, directed=False)[1])
    return [members[indices] for indices in rows.values() if len(indices) > 1]
