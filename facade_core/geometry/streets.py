"""Viewpoints along street centrelines (street paper, 3)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import LineString, Polygon

from facade_core.core.arrays import Float64Array
from facade_core.geometry.settings import STREET_VIEWPOINTS


@dataclass(frozen=True)
class Viewpoint:
    """Upright panoramic camera on a street.

    Attributes
    ----------
    id : index of the viewpoint.
    street : index of the street.
    position : (3,) metres.
    forward : (2,) horizontal unit vector along the street.
    """

    id: int
    street: int
    position: Float64Array
    forward: Float64Array


def zero_ground_heights(points: Float64Array) -> Float64Array:
    """Return zero ground heights (n,) for points (n, 2), as on level ground."""
    return np.zeros(len(points))


def place_viewpoints(
    centreline: LineString,
    *,
    spacing: float = 5.0,
    height: float = 2.5,
    obstacles: Sequence[Polygon] | shapely.STRtree = (),
    clearance: float = 0.3,
    ground: Callable[[Float64Array], Float64Array] = zero_ground_heights,
) -> tuple[Float64Array, Float64Array]:
    """Place viewpoints every `spacing` metres along a centreline.

    The first is half a spacing from the start, so that two streets that meet share none. A street from `min_street_m` to
    one spacing long has one in its middle. Viewpoints inside obstacles are dropped; a courtyard is outside.

    Parameters
    ----------
    spacing : metres between viewpoints.
    height : metres above the ground.
    obstacles : polygons, or a tree of them for many streets.
    clearance : metres from a viewpoint to an obstacle.
    ground : maps points (n, 2) to ground heights (n,).

    Returns
    -------
    (n, 3) positions in metres, and (n, 2) forward unit vectors.
    """
    if centreline.length <= spacing:
        distance = np.array([centreline.length / 2] if centreline.length >= STREET_VIEWPOINTS.min_street_m else [])
    else:
        distance = np.arange(spacing / 2, centreline.length, spacing)
    if len(distance) == 0:
        return np.empty((0, 3)), np.empty((0, 2))
    points = shapely.get_coordinates(shapely.line_interpolate_point(centreline, distance))
    step = min(0.5, spacing / 4)
    ahead = shapely.get_coordinates(
        shapely.line_interpolate_point(centreline, np.minimum(distance + step, centreline.length))
    )
    behind = shapely.get_coordinates(shapely.line_interpolate_point(centreline, np.maximum(distance - step, 0)))
    forward = ahead - behind
    length = np.linalg.norm(forward, axis=1)
    free = length > 1e-9
    tree = obstacles if isinstance(obstacles, shapely.STRtree) else shapely.STRtree(obstacles)
    free[tree.query(shapely.points(points), predicate="dwithin", distance=clearance)[0]] = False
    points, forward = points[free], forward[free] / length[free, None]
    return np.column_stack([points, ground(points) + height]), forward
