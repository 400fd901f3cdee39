"""Which panoramas are refined together: those that show the same walls, few enough for one worker, by where they are."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from facade_core.core.grouping import group_rows

# Panoramas of a bundle at most: their pictures are held at once, and the equations are solved densely.
MAX_BUNDLE_SIZE = 12
# The least share of a wall that a panorama must show to be compared on it.
MIN_WALL_SHARE = 0.25
# Pictures taken more than so many days apart may show two states of a street: they are not compared.
MAX_DAYS_APART = 400
# Side of the squares of the world, metres, that more panoramas than MOST are cut by first.
WIDEST_M = 4096.0


def group_bundles(
    wall: np.ndarray, panorama: np.ndarray, seen: np.ndarray, places: np.ndarray, days: Sequence[int | None]
) -> list[tuple[int, ...]]:
    """Bundles of two to MOST panoramas, each ascending, in the order of their first.

    wall, panorama, seen (s,): sightings, with the share of the wall that is seen; places (n, 2): east and north of the
    panoramas, metres; days: when they were taken, by number, None where that is not known.

    Connected are two panoramas that both show LEAST_SEEN of one wall, and were not taken APART_DAYS apart. What is connected
    through any number of others is one bundle. More than MOST are cut by squares of the world that are halved until few enough
    lie in each, and connected anew there: one that is added changes the bundle of its square and no other.
    """
    large = seen >= MIN_WALL_SHARE
    pairs = np.array(sorted(_pairs(wall[large], panorama[large], days)), np.int64).reshape(-1, 2)
    found: list[tuple[int, ...]] = []
    waiting = [(group, WIDEST_M) for group in _connected(np.arange(len(places)), pairs)]
    while waiting:
        group, side = waiting.pop()
        if len(group) <= MAX_BUNDLE_SIZE or side < 1e-3:  # cameras in one place, which nothing tells apart, are cut by their order
            found += [tuple(part) for i in range(0, len(group), MAX_BUNDLE_SIZE) if len(part := group[i : i + MAX_BUNDLE_SIZE].tolist()) > 1]
            continue
        _, square = np.unique(np.floor(places[group] / side), axis=0, return_inverse=True)
        for rows in group_rows(square.reshape(-1)).values():
            waiting += [(one, side / 2) for one in _connected(group[rows], pairs)]
    return sorted(found)


def _pairs(wall: np.ndarray, panorama: np.ndarray, days: Sequence[int | None]) -> set[tuple[int, int]]:
    """The panoramas that a wall connects, the smaller first."""
    found = set()
    for rows in group_rows(wall).values():
        for one, other in combinations(np.unique(panorama[rows]).tolist(), 2):
            first, second = days[one], days[other]
            if first is None or second is None or abs(first - second) <= MAX_DAYS_APART:
                found.add((one, other))
    return found


def _connected(members: np.ndarray, pairs: np.ndarray) -> list[np.ndarray]:
    """Panoramas (k,), ascending, by what pairs among them connect; those that are connected to none aside."""
    at = np.searchsorted(members, pairs[np.isin(pairs, members).all(axis=1)])
    graph = coo_array((np.ones(len(at)), (at[:, 0], at[:, 1])), (len(members), len(members)))
    rows = group_rows(connected_components(graph, directed=False)[1])
    return [members[of] for of in rows.values() if len(of) > 1]
