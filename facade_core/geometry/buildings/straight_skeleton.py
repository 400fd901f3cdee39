"""Straight skeleton of an outline, as the depth of any place inside it.

A roof of one pitch rises with that depth. A wavefront leaves all edges at unit speed; the depth of a place is the time
at which it arrives. It is the lowest of one slab per edge, where the slabs at a reflex corner end at the trace of its
motorcycle. As a function of the place it always gives a closed roof.

References
----------
Cheng and Vigneron (2002), Motorcycle graphs and straight skeletons. Huber and Held (2012), A fast straight-skeleton
algorithm based on generalized motorcycle graphs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from shapely import Polygon

from facade_core.core.arrays import Float64Array, Int64Array, ObjectArray
from facade_core.core.errors import GeometryError
from facade_core.geometry.buildings.settings import SKELETON


@dataclass(frozen=True, slots=True, eq=False)
class EdgeSlabs:
    """Slabs of an outline's straight skeleton, one per edge (n,), in the frame of each edge.

    Attributes
    ----------
    outline : the polygon.
    start, along, inward : (n, 2) frames.
    length : (n,) metres.
    before, after : (n, 2) stops of the motorcycles at the start and the end, (along, inwards); the corner without one.
    """

    outline: Polygon
    start: Float64Array
    along: Float64Array
    inward: Float64Array
    length: Float64Array
    before: Float64Array
    after: Float64Array

    def depth(self, points: Float64Array) -> Float64Array:
        """Return the depth (k,) in metres of points (k, 2) inside the outline; 0 outside."""
        batch = max(1, SKELETON.max_depth_cells // len(self.start))
        batches = [points[first : first + batch] for first in range(0, len(points), batch)]
        depth = np.concatenate([*map(self._slab_depth, batches), np.zeros(0)])
        inside = shapely.intersects_xy(self.outline.buffer(1e-6), points)
        return np.where(inside & np.isfinite(depth), np.maximum(depth, 0.0), 0.0)

    def _slab_depth(self, points: Float64Array) -> Float64Array:
        """Return the depth (k,) in metres of points (k, 2) in the lowest slab at each, inf without one."""
        offset = points[:, None] - self.start
        x, y = np.einsum("kej,ej->ke", offset, self.along), np.einsum("kej,ej->ke", offset, self.inward)
        low = np.zeros_like(y)
        sides = ((self.before, -x, -self.before[:, 0]), (self.after, x - self.length, self.after[:, 0] - self.length))
        for stop, beyond, reach in sides:
            slope = stop[:, 1] / np.maximum(reach, 1e-12)
            low = np.where(beyond > 0, np.maximum(low, np.minimum(beyond, reach) * slope), low)
            low[beyond > reach + SKELETON.slab_tolerance_m] = np.inf
        depth: Float64Array = np.where(y >= low - SKELETON.slab_tolerance_m, y, np.inf).min(axis=1)
        return depth

    def faces(self, reach: float) -> ObjectArray:
        """Return the regions (n,) in which each edge's slab is the lowest, up to `reach` metres deep."""
        ends = self.before, self.after
        corner = np.zeros((len(self.start), 2))
        far = np.column_stack([self.length, corner[:, 1]])
        high = np.full(len(self.start), reach)
        # traces end at `reach` too
        stops = [_cut_traces(stop, foot, reach) for stop, foot in zip(ends, (corner, far), strict=True)]
        top = [np.column_stack([stop[:, 0], high]) for stop in stops]
        ring = np.stack([corner, far, stops[1], top[1], top[0], stops[0]], axis=1)
        slabs = shapely.polygons(
            self.start[:, None] + ring[..., :1] * self.along[:, None] + ring[..., 1:] * self.inward[:, None]
        )
        slabs = shapely.intersection(shapely.make_valid(slabs), self.outline)
        one, other = shapely.STRtree(slabs).query(slabs, predicate="intersects")
        pair = one != other
        one, other = one[pair], other[pair]
        lower = shapely.intersection(slabs[other], self._below(other, one))
        faces: ObjectArray = slabs.copy()
        for edge in range(len(slabs)):
            faces[edge] = shapely.difference(slabs[edge], shapely.union_all(lower[one == edge]))
        return faces

    def contours(self, faces: ObjectArray, depth: float) -> ObjectArray:
        """Return the lines (n,) of one depth in metres on the faces (n,) of the edges."""
        size = self.outline.length
        foot = self.start + depth * self.inward
        ends = np.stack([foot - size * self.along, foot + (self.length[:, None] + size) * self.along], axis=1)
        contours: ObjectArray = shapely.intersection(shapely.linestrings(ends), faces)
        return contours

    def _below(self, low: Int64Array, high: Int64Array) -> ObjectArray:
        """Return large half planes (k,) in which the planes of edges `low` (k,) are below those of edges `high` (k,)."""
        size = 4 * self.outline.length
        middle = np.asarray(self.outline.centroid.coords[0])
        gradient = self.inward[low] - self.inward[high]
        offset = np.einsum("kj,kj->k", self.inward[low], middle - self.start[low])
        offset -= np.einsum("kj,kj->k", self.inward[high], middle - self.start[high])
        steep = np.hypot(*gradient.T)
        level = steep < 1e-9
        normal = np.where(level[:, None], [1.0, 0.0], gradient / np.maximum(steep, 1e-9)[:, None])
        side = np.column_stack([-normal[:, 1], normal[:, 0]])
        # parallel planes: all or nothing
        foot = np.where(level, np.where(offset < -1e-9, size, -size), -offset / np.maximum(steep, 1e-9))
        foot = np.clip(foot, -size, size)[:, None] * normal + middle
        ring = np.stack([foot - size * side, foot + size * side], axis=1)
        ring = np.concatenate([ring, ring[:, ::-1] - 2 * size * normal[:, None]], axis=1)
        polygons: ObjectArray = shapely.polygons(ring)
        return polygons


def _cut_traces(stop: Float64Array, foot: Float64Array, reach: float) -> Float64Array:
    """Shorten the stops (n, 2) of traces from `foot` to `reach` metres inwards."""
    share = np.minimum(1.0, reach / np.maximum(stop[:, 1], 1e-12))
    return foot + share[:, None] * (stop - foot)


def edge_slabs(outline: Polygon) -> EdgeSlabs:
    """Compute the slabs of a valid outline, which may have holes.

    Raises
    ------
    GeometryError
        Where a corner of the outline is a spike.
    """
    outline = shapely.orient_polygons(outline)
    rings = [_true_corners(np.asarray(ring.coords)[:-1]) for ring in (outline.exterior, *outline.interiors)]
    outline = Polygon(rings[0], rings[1:])
    start = np.concatenate(rings)
    following = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])
    first = np.cumsum([0, *map(len, rings[:-1])])
    previous = np.concatenate([np.roll(np.arange(len(ring)), 1) + at for ring, at in zip(rings, first, strict=True)])
    length = np.hypot(*(following - start).T)
    along = (following - start) / length[:, None]
    inward = np.column_stack([-along[:, 1], along[:, 0]])
    turn = along[previous, 0] * along[:, 1] - along[previous, 1] * along[:, 0]
    reflex = np.flatnonzero(turn < 0)
    bend = 1 + np.einsum("ij,ij->i", inward[previous], inward)
    if (bend[reflex] < SKELETON.min_corner_bend).any():
        raise GeometryError("an outline has a spike")
    speed = (inward[previous] + inward)[reflex] / bend[reflex, None]
    stopped = _motorcycle_stops(start[reflex], speed, start, following, reflex, previous)
    before, after = np.zeros((len(start), 2)), np.column_stack([length, np.zeros(len(start))])
    trace = stopped[:, None] * speed
    for stops, edge in ((before, reflex), (after, previous[reflex])):
        stops[edge, 0] += np.einsum("ij,ij->i", trace, along[edge])
        stops[edge, 1] = stopped
    return EdgeSlabs(outline, start, along, inward, length, before, after)


def _true_corners(ring: Float64Array) -> Float64Array:
    """Return a ring without its straight corners."""
    back, ahead = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    sine = back[:, 0] * ahead[:, 1] - back[:, 1] * ahead[:, 0]
    kept: Float64Array = ring[np.abs(sine) > SKELETON.min_corner_sine * np.hypot(*back.T) * np.hypot(*ahead.T)]
    if len(kept) < 3:
        raise GeometryError("an outline has no corners")
    return kept


def _motorcycle_stops(
    corner: Float64Array,
    speed: Float64Array,
    start: Float64Array,
    end: Float64Array,
    reflex: Int64Array,
    previous: Int64Array,
) -> Float64Array:
    """Return the time at which each motorcycle (m,) meets an edge, or the trace of an earlier one.

    corner, speed (m, 2) are their starts; start, end (n, 2) the edges; reflex (m,) the edge after each corner.
    """
    until = np.full(len(corner), np.inf)
    for k in range(len(corner)):
        time, share = _intersect_lines(corner[k], speed[k], start, end - start)
        wall = (
            (time > 1e-9) & (share >= -SKELETON.corner_tolerance_share) & (share <= 1 + SKELETON.corner_tolerance_share)
        )
        wall[[reflex[k], previous[reflex[k]]]] = False
        until[k] = time[wall].min(initial=np.inf)
    if not np.isfinite(until).all():
        raise GeometryError("an outline does not close")
    # where two traces cross, the later motorcycle stops, if the earlier one got that far
    one, other = np.triu_indices(len(corner), 1)
    mine, yours = _intersect_lines(corner[one], speed[one], corner[other], speed[other])
    crossing = (mine > 1e-9) & (yours > 1e-9)
    found = np.flatnonzero(crossing & np.isfinite(mine))
    found = found[np.argsort(np.maximum(mine[found], yours[found]), kind="stable")]
    for m, y, i, j in zip(*(column[found].tolist() for column in (mine, yours, one, other)), strict=True):
        if m <= until[i] and y <= until[j]:
            if m >= y:
                until[i] = m
            if y >= m:
                until[j] = y
    return until


def _intersect_lines(
    place: Float64Array, way: Float64Array, start: Float64Array, along: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Solve place + t way = start + s along for (t, s); infinite for parallel lines."""
    across = way[..., 0] * along[..., 1] - way[..., 1] * along[..., 0]
    apart = start - place
    flat = np.abs(across) < 1e-12
    across = np.where(flat, 1.0, across)
    time = (apart[..., 0] * along[..., 1] - apart[..., 1] * along[..., 0]) / across
    share = (apart[..., 0] * way[..., 1] - apart[..., 1] * way[..., 0]) / across
    return np.where(flat, np.inf, time), np.where(flat, np.inf, share)
