"""Nearest points on a block's mesh."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Float64Array, Int32Array, Int64Array
from facade_core.core.numba_cache import njit
from facade_core.geometry.charts import Mesh
from facade_core.geometry.raycast import MISS
from facade_core.geometry.triangle_groups import GROUP_SIZE, group_triangles
from facade_core.geometry.tuple_vectors import Vector, cross, dot, move, subtract, vector


class NearestSurface:
    """Search for the nearest points of a mesh."""

    def __init__(self, mesh: Mesh) -> None:
        self._centre = mesh.vertices.mean(axis=0)
        self._groups = group_triangles((mesh.vertices - self._centre)[mesh.triangles])
        # the last entry serves points without a place
        self._chart = np.append(mesh.chart[self._groups.order], MISS).astype(np.int32)

    def find(self, points: Float64Array) -> tuple[Float64Array, Int32Array]:
        """Return the nearest points (n, 3) of the mesh to world points (n, 3), and their charts (n,); NaN and MISS for NaN."""
        nearest, triangle = _find_nearest(
            points - self._centre, self._groups.corners, self._groups.low, self._groups.high
        )
        return nearest + self._centre, self._chart[triangle]


@njit(cache=True, nogil=True, error_model="numpy")
def _find_nearest(
    points: Float64Array, corners: Float64Array, low: Float64Array, high: Float64Array
) -> tuple[Float64Array, Int64Array]:
    """Return the nearest points (n, 3) of grouped triangles to points (n, 3), and their triangles (n,)."""
    nearest, triangle = np.full_like(points, np.nan), np.full(len(points), -1)
    to_box = np.empty(len(low))
    for n in range(len(points)):
        p, least = vector(points[n]), np.inf
        for group in range(len(low)):
            to_box[group] = 0.0
            for axis in range(3):
                outside = max(low[group, axis] - p[axis], p[axis] - high[group, axis], 0.0)
                to_box[group] += outside * outside
        first = int(np.argmin(to_box))
        for turn in range(len(low) + 1):  # the nearest box first, as it excludes most others
            group = first if turn == 0 else turn - 1
            if to_box[group] >= least:
                continue
            for t in range(group * GROUP_SIZE, min((group + 1) * GROUP_SIZE, len(corners))):
                found = _nearest_of_triangle(p, vector(corners[t, 0]), vector(corners[t, 1]), vector(corners[t, 2]))
                off = subtract(found, p)
                if dot(off, off) < least:
                    least, triangle[n] = dot(off, off), t
                    nearest[n, 0], nearest[n, 1], nearest[n, 2] = found
    return nearest, triangle


@njit(cache=True, nogil=True, error_model="numpy")
def _nearest_of_triangle(p: Vector, a: Vector, b: Vector, c: Vector) -> Vector:
    """Return the nearest point of a triangle: the foot on its plane where that lies within, else one of an edge."""
    normal, from_a = cross(subtract(b, a), subtract(c, a)), subtract(p, a)
    size = dot(normal, normal)
    along_c = dot(cross(subtract(b, a), from_a), normal)
    along_b = dot(cross(from_a, subtract(c, a)), normal)
    if size > 0.0 and along_b >= 0.0 and along_c >= 0.0 and along_b + along_c <= size:
        return move(p, -dot(from_a, normal) / size, normal)
    best, least = a, dot(from_a, from_a)
    for start, end in ((a, b), (b, c), (c, a)):
        edge = subtract(end, start)
        length = dot(edge, edge)
        share = min(max(dot(subtract(p, start), edge) / length, 0.0), 1.0) if length > 0.0 else 0.0
        found = move(start, share, edge)
        off = subtract(found, p)
        if dot(off, off) < least:
            best, least = found, dot(off, off)
    return best
