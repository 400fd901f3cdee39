"""Growth of many outlines at bounded cost."""

from __future__ import annotations

from collections.abc import Sequence

import shapely
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from facade_core.geometry.settings import GROWTH


def grow_union(
    union: BaseGeometry, outlines: Sequence[Polygon | MultiPolygon], distance: float, join_style: str = "round"
) -> BaseGeometry:
    """Grow the union of outlines by a distance, as `buffer` does.

    `buffer` intersects the offset curves of all edges within the distance: the cost is quadratic where corners are
    close. Above `max_outline_corners` or `max_corners` the union grows in steps instead, and each step merges
    corners; the result differs by the rounding of corners only.

    Parameters
    ----------
    union : union of the outlines.
    distance : metres, above 0.
    join_style : join style of `shapely.buffer`.
    """
    corners = shapely.get_num_coordinates(outlines)
    step = GROWTH.first_step_m
    while distance > 2 * step and (
        corners.max(initial=0) > GROWTH.max_outline_corners or corners.sum() > GROWTH.max_corners
    ):
        union = union.buffer(step, quad_segs=4, join_style=join_style)
        distance, step = distance - step, 2 * step
    return union.buffer(distance, join_style=join_style)
