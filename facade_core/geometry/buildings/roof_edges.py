"""Edges of a roof that are in sight of a street and free of neighbours."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from facade_core.core.arrays import Float64Array, Int64Array
from facade_core.core.fixed_order import dot_product, multiply_matrices, vector_length
from facade_core.geometry.buildings.facets import Facets
from facade_core.geometry.buildings.settings import ROOF_EDGES
from facade_core.geometry.charts import ChartKind


class RoofEdge(NamedTuple):
    """Straight piece of a roof's edge with the building on its left.

    Attributes
    ----------
    start, end : (3,) metres.
    facet : facet of the roof at the edge.
    slope : fall of the roof per metre outwards.
    width : metres of the detail along the edge.
    previous, following : adjacent edges, -1 without.
    """

    start: Float64Array
    end: Float64Array
    facet: int
    slope: float
    width: float
    previous: int = -1
    following: int = -1

    @property
    def direction(self) -> Float64Array:
        """Return the horizontal direction (2,) from start to end."""
        run = (self.end - self.start)[:2]
        unit: Float64Array = run / np.hypot(*run)
        return unit

    @property
    def outward(self) -> Float64Array:
        """Return the horizontal direction (2,) away from the building."""
        return np.array([self.direction[1], -self.direction[0]])


class RoofSurroundings(NamedTuple):
    """Surroundings of a roof's edges; without street points every edge is in sight.

    Attributes
    ----------
    neighbours : area covered by neighbours as high as the roof.
    street_points : (k, 2) places on streets.
    footprints : tree of the footprints that block the view.
    """

    neighbours: BaseGeometry
    street_points: Float64Array
    footprints: shapely.STRtree

    def is_in_sight(self, place: Float64Array, out: Float64Array) -> bool:
        """Return whether a place (2,) on an outline is seen from a street on its outer side `out` (2,)."""
        if not len(self.street_points):
            return True
        towards = self.street_points - place
        ahead = (multiply_matrices(towards, out) > 1.0) & (np.hypot(*towards.T) < ROOF_EDGES.max_sight_m)
        near = towards[ahead][np.argsort(np.hypot(*towards[ahead].T), kind="stable")[: ROOF_EDGES.max_sight_lines]]
        sights = shapely.linestrings(
            np.stack(np.broadcast_arrays(place + ROOF_EDGES.neighbour_clearance_m * out, place + near), axis=1)
        )
        sight, footprint = self.footprints.query(sights)
        blocked = shapely.intersects(self.footprints.geometries[footprint], sights[sight])
        return len(np.unique(sight[blocked])) < len(sights)


OPEN_SURROUNDINGS = RoofSurroundings(shapely.GeometryCollection(), np.empty((0, 2)), shapely.STRtree([]))


def sample_streets(lines: Sequence[shapely.LineString]) -> Float64Array:
    """Return places (k, 2) along street centrelines."""
    places = [
        shapely.line_interpolate_point(line, np.arange(0, line.length, ROOF_EDGES.street_sampling_m)) for line in lines
    ]
    return shapely.get_coordinates(np.concatenate(places)) if places else np.empty((0, 2))


def roof_edges(roof: Facets, outline: Polygon) -> list[RoofEdge]:
    """Return the outer edges of a roof's facets, with collinear sides joined."""
    ends, facet = _outer_edges(roof, outline)
    runs = _straight_runs(roof, ends, facet)
    begins = {int(ends[run[0], 0]): number for number, run in enumerate(runs)}
    closes = {int(ends[run[-1], 1]): number for number, run in enumerate(runs)}
    edges = []
    for run in runs:
        first, last = int(ends[run[0], 0]), int(ends[run[-1], 1])
        edge = RoofEdge(roof.vertices[first], roof.vertices[last], int(facet[run[0]]), 0.0, 0.0)
        normal = roof.normal[edge.facet]
        fall = float(dot_product(normal[:2], edge.outward) / normal[2])
        edges.append(edge._replace(slope=fall, previous=closes.get(first, -1), following=begins.get(last, -1)))
    return edges


def _outer_edges(roof: Facets, outline: Polygon) -> tuple[Int64Array, Int64Array]:
    """Return the vertex pairs (e, 2) and facets (e,) of triangle sides on the outline that no other triangle shares."""
    upper = roof.kind[roof.facet] == ChartKind.ROOF
    triangles, facet = roof.triangles[upper], np.tile(roof.facet[upper], 3)
    ends = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    count = len(roof.vertices)
    outer = ~np.isin(ends @ [count, 1], ends @ [1, count])
    ends, facet = ends[outer], facet[outer]
    places = roof.vertices[ends]
    on = (
        shapely.distance(shapely.points(places.mean(axis=1)[:, :2]), outline.boundary) < ROOF_EDGES.outline_tolerance_m
    ) & (np.hypot(*(places[:, 1] - places[:, 0])[:, :2].T) > ROOF_EDGES.outline_tolerance_m)
    return ends[on], facet[on]


def _straight_runs(roof: Facets, ends: Int64Array, facet: Int64Array) -> list[list[int]]:
    """Group sides (e, 2) of facets (e,) into straight edges, in order."""
    following = dict(zip(ends[:, 0].tolist(), range(len(ends)), strict=True))
    preceding = dict(zip(ends[:, 1].tolist(), range(len(ends)), strict=True))
    runs: list[list[int]] = []
    taken = np.zeros(len(ends), bool)

    def is_in_line(one: int, other: int) -> bool:
        first, second = (roof.vertices[ends[e, 1]] - roof.vertices[ends[e, 0]] for e in (one, other))
        straight = dot_product(first, second) > (1 - 1e-6) * vector_length(first) * vector_length(second)
        return bool(facet[one] == facet[other] and straight)

    for begin in range(len(ends)):
        back = preceding.get(int(ends[begin, 0]), -1)
        if taken[begin] or (back >= 0 and back != begin and is_in_line(back, begin)):
            continue
        run = [begin]
        taken[begin] = True
        while (
            (ahead := following.get(int(ends[run[-1], 1]), -1)) >= 0 and not taken[ahead] and is_in_line(run[-1], ahead)
        ):
            run.append(ahead)
            taken[ahead] = True
        runs.append(run)
    return runs


def cut_free_roof_edges(edges: Sequence[RoofEdge], surroundings: RoofSurroundings) -> list[RoofEdge]:
    """Return the pieces of edges in sight without an adjoining neighbour."""
    found: list[RoofEdge] = []
    first: dict[int, int] = {}
    last: dict[int, int] = {}
    for number, edge in enumerate(edges):
        length = float(np.hypot(*(edge.end - edge.start)[:2]))
        sight_points = (edge.start + share * (edge.end - edge.start) for share in (0.5, 0.1, 0.9))
        if not any(surroundings.is_in_sight(place[:2], edge.outward) for place in sight_points):
            continue
        reach = max(edge.width, 0.0) + ROOF_EDGES.neighbour_clearance_m
        a, b, near, far = edge.start[:2], edge.end[:2], 0.02 * edge.outward, reach * edge.outward
        beside = shapely.intersection(Polygon([a + near, b + near, b + far, a + far]), surroundings.neighbours)
        free = [(0.0, length)]
        for part in shapely.get_parts(beside):
            if part.area > 1e-4:
                steps = multiply_matrices(shapely.get_coordinates(part) - a, edge.direction)
                low, high = float(steps.min()), float(steps.max())
                if high > ROOF_EDGES.max_touch_m and low < length - ROOF_EDGES.max_touch_m:
                    free = [
                        piece
                        for left, right in free
                        for piece in ((left, min(right, low)), (max(left, high), right))
                        if piece[1] > piece[0]
                    ]
        for left, right in free:
            if right - left < min(ROOF_EDGES.min_edge_m, length - ROOF_EDGES.max_touch_m):
                continue
            if left == 0:
                first[number] = len(found)
            if right == length:
                last[number] = len(found)
            start, end = (edge.start + share * (edge.end - edge.start) for share in (left / length, right / length))
            found.append(edge._replace(start=start, end=end, previous=-1, following=-1))
    for number, own in last.items():
        if (following := first.get(edges[number].following, -1)) >= 0:
            found[own] = found[own]._replace(following=following)
            found[following] = found[following]._replace(previous=own)
    return found
