"""Ray parity test for the inside of a shell."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, Int64Array
from facade_core.core.numba_cache import njit
from facade_core.geometry.settings import CROSSINGS
from facade_core.geometry.triangle_groups import GROUP_SIZE, group_triangles
from facade_core.geometry.tuple_vectors import Vector, cross, dot, subtract, vector

# Offsets of the three rays of a point, so that no ray hits an edge of an upright world exactly.
RAY_TILTS = np.array([[0.0123, 0.0071, 0.0047], [-0.0087, 0.0131, 0.0059], [0.0031, -0.0149, 0.0083]])


class RayCrossingCounter:
    """Counter of ray crossings with the triangles (t, 3, 3) of a shell, each of a facet (t,)."""

    def __init__(self, corners: Float64Array, facet: Int64Array) -> None:
        self._centre = corners.reshape(-1, 3).mean(axis=0) if len(corners) else np.zeros(3)
        self._groups = group_triangles(corners - self._centre) if len(corners) else None
        self._facet = facet[self._groups.order] if self._groups else facet

    def has_odd_crossings(self, points: Float64Array, directions: Float64Array, own: Int64Array) -> BoolArray:
        """Return whether most of three rays from each point cross an odd number of triangles.

        Parameters
        ----------
        points : (n, 3) metres.
        directions : (n, 3).
        own : (n,) facet whose triangles do not count.

        Returns
        -------
        (n,).
        """
        odd = np.zeros(len(points), np.int64)
        if self._groups is None or len(points) == 0:
            return odd > 0
        for tilt in RAY_TILTS:
            odd += (
                _count_crossings(
                    points - self._centre,
                    directions + tilt,
                    own,
                    self._groups.corners,
                    self._facet,
                    self._groups.low,
                    self._groups.high,
                    CROSSINGS.min_hit_m,
                )
                % 2
            )
        return odd > len(RAY_TILTS) // 2


@njit(cache=True, nogil=True, error_model="numpy")
def _count_crossings(
    points: Float64Array,
    directions: Float64Array,
    own: Int64Array,
    corners: Float64Array,
    facet: Int64Array,
    low: Float64Array,
    high: Float64Array,
    least: float,
) -> Int64Array:
    """Count the places (n,) where each ray crosses triangles farther than `least` lengths of its direction.

    A face that is drawn twice counts once.

    References
    ----------
    Möller, Trumbore, Fast, Minimum Storage Ray/Triangle Intersection, Journal of Graphics Tools 2(1), 1997.
    """
    crossed, places = np.zeros(len(points), np.int64), np.empty(len(corners), np.float32)
    for n in range(len(points)):
        p, ahead, met = vector(points[n]), vector(directions[n]), 0
        for group in range(len(low)):
            if not _meets_box(p, ahead, low[group], high[group]):
                continue
            for t in range(group * GROUP_SIZE, min((group + 1) * GROUP_SIZE, len(corners))):
                if facet[t] != own[n]:
                    place = _distance(p, ahead, vector(corners[t, 0]), vector(corners[t, 1]), vector(corners[t, 2]))
                    if place > least:
                        places[met] = place
                        met += _is_new(places, met)
        crossed[n] = met
    return crossed


@njit(cache=True, nogil=True)
def _is_new(places: Float32Array, last: int) -> bool:
    """Return whether a place differs from those before it."""
    seen = False
    for other in range(last):
        seen |= places[other] == places[last]
    return not seen


@njit(cache=True, nogil=True, error_model="numpy")
def _distance(p: Vector, ahead: Vector, a: Vector, b: Vector, c: Vector) -> float:
    """Return the distance of a triangle along a ray in lengths of its direction; -1 where they do not meet."""
    edge, other, start = subtract(b, a), subtract(c, a), subtract(p, a)
    across, beside = cross(ahead, other), cross(start, edge)
    size = dot(edge, across)
    if size == 0.0:
        return -1.0
    u, v = dot(start, across) / size, dot(ahead, beside) / size
    return dot(other, beside) / size if u >= 0.0 and v >= 0.0 and u + v <= 1.0 else -1.0


@njit(cache=True, nogil=True, error_model="numpy")
def _meets_box(p: Vector, ahead: Vector, low: Float64Array, high: Float64Array) -> bool:
    """Return whether a ray, of which no direction is exactly along an axis, meets a box."""
    near, far = 0.0, np.inf
    for axis in range(3):
        one, other = (low[axis] - p[axis]) / ahead[axis], (high[axis] - p[axis]) / ahead[axis]
        near, far = max(near, min(one, other)), min(far, max(one, other))
    return near <= far
