"""Growth of many outlines at bounded cost."""

from __future__ import annotations

from collections.abc import Sequence

import shapely
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

# Corners of one outline, and of all, above which an area grows in steps.
MAX_OUTLINE_CORNERS = 500
MAX_CORNERS = 20_000
# First of the steps in metres; each is twice the step before.
FIRST_STEP_M = 0.25


def grow_union(
    union: BaseGeometry, outlines: Sequence[Polygon | MultiPolygon], distance: float, join_style: str = "round"
) -> BaseGeometry:
    """Grow the union of outlines by a distance, as `buffer` does.

    `buffer` intersects the offset curves of all edges within the distance: the cost is quadratic where corners are
    close. Above MAX_OUTLINE_CORNERS or MAX_CORNERS the union grows in steps instead, and each step merges
    corners; the result differs by the rounding of corners only.

    Parameters
    ----------
    union : union of the outlines.
    distance : metres, above 0.
    join_style : join style of `shapely.buffer`.
    """
    corners = shapely.get_num_coordinates(outlines)
    step = FIRST_STEP_M
    while distance > 2 * step and (corners.max(initial=0) > MAX_OUTLINE_CORNERS or corners.sum() > MAX_CORNERS):
        union = union.buffer(step, quad_segs=4, join_style=join_style)
        distance, step = distance - step, 2 * step
    return union.buffer(distance, join_style=join_style)
