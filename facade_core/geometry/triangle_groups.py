"""Triangles in groups that lie near each other, with the boxes of the groups: searches pass most groups over."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import Float64Array, Int64Array

# Triangles of a group.
GROUP_SIZE = 32
# Cells along each axis of the curve that orders triangles, as a power of two.
_CURVE_BITS = 10


class TriangleGroups(NamedTuple):
    """Triangles along a curve through space; group g has those from GROUP_SIZE * g on.

    Attributes
    ----------
    order : (t,) number of each triangle as given.
    corners : (t, 3, 3) metres.
    low, high : (g, 3) box of each group.
    """

    order: Int64Array
    corners: Float64Array
    low: Float64Array
    high: Float64Array


def group_triangles(corners: Float64Array) -> TriangleGroups:
    """Order triangles (t, 3, 3), at least one, along a Z-order curve through their middles."""
    middle = corners.mean(axis=1)
    middle -= middle.min(axis=0)
    cells = (middle / max(float(middle.max()), 1e-9) * (2**_CURVE_BITS - 1)).astype(np.int64)
    bits = (cells[:, :, None] >> np.arange(_CURVE_BITS)) & 1
    order = np.argsort((bits << (3 * np.arange(_CURVE_BITS) + np.arange(3)[:, None])).sum(axis=(1, 2)), kind="stable")
    corners = np.ascontiguousarray(corners[order], np.float64)
    starts = np.arange(0, len(corners), GROUP_SIZE)
    low = np.minimum.reduceat(corners.min(axis=1), starts)
    high = np.maximum.reduceat(corners.max(axis=1), starts)
    return TriangleGroups(order, corners, low, high)
