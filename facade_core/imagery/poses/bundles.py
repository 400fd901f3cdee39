"""Bundles of panoramas for joint refinement, by common walls, limited in number by position."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from facade_core.core.arrays import Float64Array, Int32Array, Int64Array
from facade_core.core.grouping import RowsByValue, group_rows
from facade_core.imagery.poses.settings import PANORAMA_BUNDLES


def group_panoramas_into_bundles(
    wall: Int32Array, panorama: Int32Array, seen: Float64Array, places: Float64Array, days: Sequence[int | None]
) -> list[tuple[int, ...]]:
    """Group panoramas that show the same walls into bundles of two to max_bundle_size.

    Two panoramas are connected if both show min_wall_share of one wall and were taken within max_days_apart. Connected
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
    is_large = seen >= PANORAMA_BUNDLES.min_wall_share
    pairs = _comparable_pairs(wall[is_large], panorama[is_large], days)
    bundles: list[tuple[int, ...]] = []
    pending = [(*group, PANORAMA_BUNDLES.first_square_m) for group in _connected_groups(np.arange(len(places)), pairs)]
    while pending:
        group, linked, side = pending.pop()
        if (
            len(group) <= PANORAMA_BUNDLES.max_bundle_size or side < 1e-3
        ):  # cameras at one position are divided by their order
            bundles += [
                tuple(part)
                for i in range(0, len(group), PANORAMA_BUNDLES.max_bundle_size)
                if len(part := group[i : i + PANORAMA_BUNDLES.max_bundle_size].tolist()) > 1
            ]
            continue
        _, square = np.unique(np.floor(places[group] / side), axis=0, return_inverse=True)
        square = square.reshape(-1)
        ends = square[np.searchsorted(group, linked)]
        linked, within = linked[ends[:, 0] == ends[:, 1]], ends[ends[:, 0] == ends[:, 1], 0]
        pairs_of = RowsByValue(within)
        for number, rows in group_rows(square).items():
            parts = _connected_groups(group[rows], linked[pairs_of.rows_with(number)])
            pending += [(*part, side / 2) for part in parts]
    return sorted(bundles)


def _comparable_pairs(wall: Int32Array, panorama: Int32Array, days: Sequence[int | None]) -> Int64Array:
    """Pairs (p, 2) of panoramas that a wall connects, ascending, the smaller index first."""
    day = np.array([np.nan if one is None else one for one in days], np.float64)
    found = [np.zeros(0, np.int64)]
    for rows in group_rows(wall).values():
        own = np.unique(panorama[rows]).astype(np.int64)
        first, second = (own[side] for side in np.triu_indices(len(own), 1))
        apart = np.abs(day[first] - day[second]) > PANORAMA_BUNDLES.max_days_apart  # False where a day is unknown
        found.append((first * len(day) + second)[~apart])
    return np.stack(np.divmod(np.unique(np.concatenate(found)), max(1, len(day))), axis=1)


def _connected_groups(members: Int64Array, pairs: Int64Array) -> list[tuple[Int64Array, Int64Array]]:
    """Return the connected groups of the members, ascending, each with its pairs (p, 2); unconnected ones are left out."""
    local = np.searchsorted(members, pairs)
    graph = coo_array((np.ones(len(local)), (local[:, 0], local[:, 1])), (len(members), len(members)))
    label = connected_components(graph, directed=False)[1]
    pairs_of = RowsByValue(label[local[:, 0]])
    return [
        (members[indices], pairs[pairs_of.rows_with(number)])
        for number, indices in group_rows(label).items()
        if len(indices) > 1
    ]
