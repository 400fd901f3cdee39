"""The edges of a roof: which there are, which are in sight, and beside which nothing stands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from facade_core.geometry.buildings.facets import Facets
from facade_core.geometry.charts import ChartKind

# Shorter pieces are left out.
SHORTEST_M = 0.6
# Nearer than this a neighbour is in the way; what touches the end of an edge by less is not.
ASIDE_M, TOUCH_M = 0.1, 0.05
# An edge is in sight from places on streets up to this far away, a few metres apart; the nearest of these are looked from.
SEEN_M, STEP_M, LOOKS = 60.0, 4.0, 8
# Ends of edges on the outline lie this near to it.
ON_OUTLINE_M = 5e-3


class Edge(NamedTuple):
    """A straight piece of a roof's edge with the building on its left: ends (3,), the facet of the roof there, how far the roof
    falls per metre outwards, how wide what is drawn along it is, and the pieces that go on before and after it, -1 where none
    does."""

    start: np.ndarray
    end: np.ndarray
    facet: int
    fall: float
    wide: float
    before: int = -1
    after: int = -1

    @property
    def ahead(self) -> np.ndarray:
        run = (self.end - self.start)[:2]
        return run / np.hypot(*run)

    @property
    def out(self) -> np.ndarray:
        return np.array([self.ahead[1], -self.ahead[0]])


class Around(NamedTuple):
    """What a roof's edge has about it: what neighbours cover that are as high; places on streets, and the footprints that may
    stand between. Without places every edge is in sight."""

    high: BaseGeometry
    eyes: np.ndarray
    built: shapely.STRtree

    def in_sight(self, place: np.ndarray, out: np.ndarray) -> bool:
        """Whether a place (2,) on an outline is seen from a street on its outer side, `out` (2,)."""
        if not len(self.eyes):
            return True
        towards = self.eyes - place
        ahead = (towards @ out > 1.0) & (np.hypot(*towards.T) < SEEN_M)
        near = towards[ahead][np.argsort(np.hypot(*towards[ahead].T), kind="stable")[:LOOKS]]
        sights = shapely.linestrings(np.stack(np.broadcast_arrays(place + ASIDE_M * out, place + near), axis=1))
        return len(np.unique(self.built.query(sights, predicate="intersects")[0])) < len(sights)


OPEN = Around(shapely.GeometryCollection(), np.empty((0, 2)), shapely.STRtree([]))


def along_streets(lines: Sequence[shapely.LineString]) -> np.ndarray:
    """Places (k, 2) along streets, from which roofs are seen."""
    places = [shapely.line_interpolate_point(line, np.arange(0, line.length, STEP_M)) for line in lines]
    return shapely.get_coordinates(np.concatenate(places)) if places else np.empty((0, 2))


def roof_edges(roof: Facets, outline: Polygon) -> list[Edge]:
    """The outer edges of a roof's facets, those in line as one."""
    ends, facet = _outer_edges(roof, outline)
    runs = _in_line(roof, ends, facet)
    begins = {int(ends[run[0], 0]): number for number, run in enumerate(runs)}
    closes = {int(ends[run[-1], 1]): number for number, run in enumerate(runs)}
    edges = []
    for run in runs:
        first, last = int(ends[run[0], 0]), int(ends[run[-1], 1])
        edge = Edge(roof.vertices[first], roof.vertices[last], int(facet[run[0]]), 0.0, 0.0)
        normal = roof.normal[edge.facet]
        fall = float(normal[:2] @ edge.out / normal[2])
        edges.append(edge._replace(fall=fall, before=closes.get(first, -1), after=begins.get(last, -1)))
    return edges


def _outer_edges(roof: Facets, outline: Polygon) -> tuple[np.ndarray, np.ndarray]:
    """The ends (e, 2) of the sides of a roof's triangles that are no other's too and lie on the outline, vertices; and the
    facet (e,) of each."""
    upper = roof.kind[roof.facet] == ChartKind.ROOF
    triangles, facet = roof.triangles[upper], np.tile(roof.facet[upper], 3)
    ends = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    count = len(roof.vertices)
    outer = ~np.isin(ends @ [count, 1], ends @ [1, count])
    ends, facet = ends[outer], facet[outer]
    places = roof.vertices[ends]
    on = (shapely.distance(shapely.points(places.mean(axis=1)[:, :2]), outline.boundary) < ON_OUTLINE_M) & (
        np.hypot(*(places[:, 1] - places[:, 0])[:, :2].T) > ON_OUTLINE_M
    )
    return ends[on], facet[on]


def _in_line(roof: Facets, ends: np.ndarray, facet: np.ndarray) -> list[list[int]]:
    """Sides (e, 2) of facets (e,) in runs, each the straight edge of one facet, in order."""
    following = dict(zip(ends[:, 0].tolist(), range(len(ends)), strict=True))
    preceding = dict(zip(ends[:, 1].tolist(), range(len(ends)), strict=True))
    runs: list[list[int]] = []
    taken = np.zeros(len(ends), bool)

    def in_line(one: int, other: int) -> bool:
        first, second = (roof.vertices[ends[e, 1]] - roof.vertices[ends[e, 0]] for e in (one, other))
        straight = first @ second > (1 - 1e-6) * np.linalg.norm(first) * np.linalg.norm(second)
        return bool(facet[one] == facet[other] and straight)

    for begin in range(len(ends)):
        back = preceding.get(int(ends[begin, 0]), -1)
        if taken[begin] or (back >= 0 and back != begin and in_line(back, begin)):
            continue
        run = [begin]
        taken[begin] = True
        while (ahead := following.get(int(ends[run[-1], 1]), -1)) >= 0 and not taken[ahead] and in_line(run[-1], ahead):
            run.append(ahead)
            taken[ahead] = True
        runs.append(run)
    return runs


def free_pieces(edges: Sequence[Edge], around: Around) -> list[Edge]:
    """The pieces of edges that are in sight and beside which nothing stands."""
    found: list[Edge] = []
    first: dict[int, int] = {}
    last: dict[int, int] = {}
    for number, edge in enumerate(edges):
        length = float(np.hypot(*(edge.end - edge.start)[:2]))
        looks = (edge.start + share * (edge.end - edge.start) for share in (0.5, 0.1, 0.9))
        if not any(around.in_sight(place[:2], edge.out) for place in looks):
            continue
        reach = max(edge.wide, 0.0) + ASIDE_M
        a, b, near, far = edge.start[:2], edge.end[:2], 0.02 * edge.out, reach * edge.out
        beside = shapely.intersection(Polygon([a + near, b + near, b + far, a + far]), around.high)
        free = [(0.0, length)]
        for part in shapely.get_parts(beside):
            if part.area > 1e-4:
                steps = (shapely.get_coordinates(part) - a) @ edge.ahead
                low, high = float(steps.min()), float(steps.max())
                if high > TOUCH_M and low < length - TOUCH_M:
                    free = [
                        piece
                        for left, right in free
                        for piece in ((left, min(right, low)), (max(left, high), right))
                        if piece[1] > piece[0]
                    ]
        for left, right in free:
            if right - left < min(SHORTEST_M, length - TOUCH_M):
                continue
            if left == 0:
                first[number] = len(found)
            if right == length:
                last[number] = len(found)
            start, end = (edge.start + share * (edge.end - edge.start) for share in (left / length, right / length))
            found.append(edge._replace(start=start, end=end, before=-1, after=-1))
    for number, own in last.items():
        if (following := first.get(edges[number].after, -1)) >= 0:
            found[own] = found[own]._replace(after=following)
            found[following] = found[following]._replace(before=own)
    return found
