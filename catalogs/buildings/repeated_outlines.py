"""Buildings of one source that repeat the outline of another."""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from catalogs.buildings.settings import SITES
from facade_core.core.arrays import BoolArray, Int64Array


def find_repeated_outlines(
    outlines: Sequence[BaseGeometry], kinds: Sequence[Hashable], precedence: Sequence[float]
) -> BoolArray:
    """Return for each outline whether an outline of its kind and of higher precedence is equal to it.

    Of equal precedence the first is kept. Outlines are equal where they have SITES.min_common_share in common.

    Parameters
    ----------
    outlines : n outlines in metres.
    kinds : (n,) kinds, such as the lower end: different ones are never equal.
    precedence : (n,) numbers, the highest is kept.
    """
    numbers = {kind: number for number, kind in enumerate(dict.fromkeys(kinds))}
    kind = np.array([numbers[one] for one in kinds], np.int64)
    repeated = np.zeros(len(outlines), bool)
    if len(outlines) < 2:
        return repeated
    shapes = np.array(outlines, dtype=object)
    bounds, areas = shapely.bounds(shapes), shapely.area(shapes)
    tree = shapely.STRtree(shapely.centroid(shapes))
    decided = np.zeros(len(outlines), bool)
    for index in np.argsort(-np.asarray(precedence, np.float64), kind="stable").tolist():
        if decided[index]:
            continue
        decided[index] = True
        near: Int64Array = tree.query(shapely.centroid(shapes[index]).buffer(SITES.max_bounds_offset_m))
        near = near[~decided[near] & (kind[near] == kind[index])]
        near = near[np.abs(bounds[near] - bounds[index]).max(axis=1, initial=0.0) < SITES.max_bounds_offset_m]
        common = shapely.area(shapely.intersection(shapes[near], shapes[index]))
        equal = near[common >= SITES.min_common_share * np.maximum(areas[near], areas[index])]
        repeated[equal] = decided[equal] = True
    return repeated
