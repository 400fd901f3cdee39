"""Repair of modelled roofs that single corners pull down through the walls."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, Int64Array, UInt8Array
from facade_core.core.types import SEMANTICS, BuildingShell

# Grid on which the corners of surfaces are one; metres.
WELD_M = 0.001
# A corner is sunken where all corners of its roof surfaces are higher by more than this; metres.
MIN_SUNKEN_M = 3.0
# Corners up to this height over the lowest point of a model may be the foot of a wall; metres.
MAX_FOOT_M = 2.0
# The roof is steeper than 45 degrees on all sides of a sunken corner.
MAX_STEEP_NZ = np.sqrt(0.5)
# Triangles that are narrower than this from above are walls; metres.
MIN_PLAN_WIDTH_M = 0.1
# Where more of a roof's corners are low, they are its shape, such as a helm roof over four gables.
MAX_SUNKEN_SHARE = 1 / 3

ROOF_LIKE = (SEMANTICS.index("roof"), SEMANTICS.index("unknown"))


def raise_sunken_corners(shell: BuildingShell) -> tuple[BuildingShell, int]:
    """Raise corners of a roof that are far below all others around them to the lowest of these.

    Measured eaves have outliers, such as one of 6 m among those of 30 m: the roof falls from there through the wall.

    Returns
    -------
    The shell, and the number of raised corners.
    """
    cells = np.round(shell.vertices / WELD_M).astype(np.int64)
    _, first, corner = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    corner = corner.ravel()
    triangles = corner[shell.triangles]
    places = shell.vertices[first]
    is_roof, is_steep = _classify_triangles(places[triangles], shell.semantic)
    if not is_roof.any():
        return shell, 0
    height = places[:, 2]
    around = _lowest_around(height, triangles[is_roof])
    has_roof = np.isfinite(around)
    has_flat_roof = np.zeros(len(height), bool)
    has_flat_roof[triangles[is_roof & ~is_steep]] = True
    foot = height[triangles].min() + MAX_FOOT_M
    sunken = has_roof & ~has_flat_roof & (around - height > MIN_SUNKEN_M) & (height > foot)
    if not 0 < sunken.sum() <= MAX_SUNKEN_SHARE * has_roof.sum():
        return shell, 0
    vertices = shell.vertices.copy()
    vertices[:, 2] = np.where(sunken[corner], around[corner], vertices[:, 2])
    return replace(shell, vertices=vertices), int(sunken.sum())


def _classify_triangles(corners: Float64Array, semantic: UInt8Array) -> tuple[BoolArray, BoolArray]:
    """Return which triangles (t, 3, 3) may be of a roof, and which of all are steep."""
    edges = np.roll(corners, -1, axis=1) - corners
    normal = np.cross(edges[:, 0], edges[:, 1])
    size, longest = np.linalg.norm(normal, axis=1), np.hypot(edges[..., 0], edges[..., 1]).max(axis=1)
    is_wide = np.abs(normal[:, 2]) > MIN_PLAN_WIDTH_M * longest
    return is_wide & np.isin(semantic, ROOF_LIKE), np.abs(normal[:, 2]) < MAX_STEEP_NZ * size


def _lowest_around(height: Float64Array, triangles: Int64Array) -> Float64Array:
    """Return for each corner the lowest other corner of its triangles (t, 3), metres; infinity without any."""
    lowest = np.full(len(height), np.inf)
    for k in range(3):
        others = height[np.roll(triangles, -k, axis=1)[:, 1:]].min(axis=1)
        np.minimum.at(lowest, triangles[:, k], others)
    return lowest
