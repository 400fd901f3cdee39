"""What stands out at a roof's edge where no neighbour does: eaves and verges of pitched roofs, parapets of flat ones.

They are drawn beside the building's closed surfaces, as installations on it: walls and roofs end where they would without.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from facade_core.geometry.charts import CEILING, ROOF, WALL
from facade_core.geometry.facets import Facets

# How far a roof reaches beyond a wall below its eaves, and beyond a gable; how far below the edge its cove meets the wall.
OVERHANG_M, VERGE_M, THICK_M = 0.4, 0.2, 0.22
# It ends no lower than this under the eaves; one steeper than the second figure runs out as flat as the third (slopes).
LOWER_M, STEEP, FLAT = 0.3, 1.0, 0.2
# A parapet, over a roof that is higher than the third figure: lower ones have none.
PARAPET_M, COPING_M, LOW_ROOF_M = 0.4, 0.3, 4.0
# Shorter pieces are left out, and so are all of a roof with more edges than this: it is round.
SHORTEST_M, MOST = 0.6, 48
# Edges meet in a mitre up to this many times as long as they are wide.
MITRE = 2.5
# And where their heights there differ by less than this.
LEVEL_M = 5e-3
# Nearer than this a neighbour is in the way; what touches the end of an edge by less is not.
ASIDE_M, TOUCH_M = 0.1, 0.05
# An edge is in sight from places on streets up to this far away, a few metres apart; the nearest of these are looked from.
SEEN_M, STEP_M, LOOKS = 60.0, 4.0, 8
# Ends of edges on the outline lie this near to it.
ON_OUTLINE_M = 5e-3


class Edge(NamedTuple):
    """A straight piece of a roof's edge with the building on its left: ends (3,), the facet of the roof there, how far the roof
    falls per metre outwards, how wide its overhang is, and the pieces that go on before and after it, -1 where none does."""

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
    def lower(self) -> float:
        """How far its overhang falls per metre outwards."""
        return FLAT if self.fall > STEEP else self.fall

    @property
    def out(self) -> np.ndarray:
        return np.array([self.ahead[1], -self.ahead[0]])


class Trim(NamedTuple):
    """Facets that are drawn beside a roof, and the directions (f, 3) of their charts' right."""

    facets: Facets
    along: np.ndarray


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


def overhang(roof: Facets, outline: Polygon, around: Around) -> tuple[Facets, Trim | None]:
    """The facets of a pitched roof drawn out over its eaves and verges, and the coves below; the roof as it is where there is
    nowhere to."""
    offsets, edges = _offsets(_free(_edges(roof, outline), around))
    if not edges:
        return roof, None
    faces = Faces()
    strips, facet, normals = [], [], list(roof.normal)
    level: dict[tuple[int, float], int] = {}
    # one for all, so that coves meet at corners
    below = np.array([0.0, 0.0, max(edge.wide * edge.lower for edge in edges) + THICK_M])
    for edge, (left, right) in zip(edges, offsets, strict=True):
        strips.append([edge.start, left, right, edge.end])
        if edge.fall > STEEP:
            # a kink: the strip lies in a plane of its own
            way = (edge.facet, round(float(np.arctan2(*edge.out)), 3))
            facet.append(level.setdefault(way, len(normals)))
            if facet[-1] == len(normals):
                normals.append(_normal(*strips[-1][:3]))
        else:
            facet.append(edge.facet)
        faces.add(CEILING, [edge.start - below, edge.end - below, right, left])
        if edge.before < 0:
            faces.add(WALL, [edge.start - below, left, edge.start])
        if edge.after < 0:
            faces.add(WALL, [right, edge.end - below, edge.end])
    return _with_strips(roof, np.array(strips), np.array(facet), np.array(normals)), faces.trim()


def parapet(outline: Polygon, top: float, around: Around) -> Trim | None:
    """A low wall along the edges of a flat roof at height `top`, which slopes inwards; None where neighbours are all around."""
    edges: list[Edge] = []
    for ring in (outline.exterior, *outline.interiors):
        corners = np.column_stack([np.asarray(ring.coords), np.full(len(ring.coords), top)])
        first, count = len(edges), len(corners) - 1
        for k in range(count):
            before, after = first + (k - 1) % count, first + (k + 1) % count
            edges.append(Edge(corners[k], corners[k + 1], -1, 0.0, -COPING_M, before, after))
    offsets, edges = _offsets(_free(edges, around._replace(eyes=OPEN.eyes)))
    if not edges:
        return None
    faces = Faces()
    high = np.array([0.0, 0.0, PARAPET_M])
    for edge, (left, right) in zip(edges, offsets, strict=True):
        faces.add(WALL, [edge.start, edge.end, edge.end + high, edge.start + high])
        faces.add(ROOF, [edge.start + high, edge.end + high, right, left])
        if edge.before < 0:
            faces.add(WALL, [left, edge.start, edge.start + high])
        if edge.after < 0:
            faces.add(WALL, [edge.end, right, edge.end + high])
    return faces.trim()


def _edges(roof: Facets, outline: Polygon) -> list[Edge]:
    """The outer edges of a roof's facets, those in line as one."""
    upper = roof.kind[roof.facet] == ROOF
    triangles, facet = roof.triangles[upper], np.tile(roof.facet[upper], 3)
    ends = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    count = len(roof.vertices)
    outer = ~np.isin(ends @ [count, 1], ends @ [1, count])
    ends, facet = ends[outer], facet[outer]
    places = roof.vertices[ends]
    on = (shapely.distance(shapely.points(places.mean(axis=1)[:, :2]), outline.boundary) < ON_OUTLINE_M) & (
        np.hypot(*(places[:, 1] - places[:, 0])[:, :2].T) > ON_OUTLINE_M
    )
    ends, facet = ends[on], facet[on]
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
    begins = {int(ends[run[0], 0]): number for number, run in enumerate(runs)}
    closes = {int(ends[run[-1], 1]): number for number, run in enumerate(runs)}
    edges = []
    for run in runs:
        start, end = roof.vertices[ends[run[0], 0]], roof.vertices[ends[run[-1], 1]]
        edge = Edge(start, end, int(facet[run[0]]), 0.0, 0.0)
        normal = roof.normal[edge.facet]
        fall = float(normal[:2] @ edge.out / normal[2])
        sloped = abs(end[2] - start[2]) > 0.1 * np.hypot(*(end - start)[:2])
        wide = VERGE_M if sloped or fall <= 0 else min(OVERHANG_M, LOWER_M / fall) if fall <= STEEP else OVERHANG_M
        before, after = closes.get(int(ends[run[0], 0]), -1), begins.get(int(ends[run[-1], 1]), -1)
        edges.append(edge._replace(fall=fall, wide=wide, before=before, after=after))
    return edges


def _free(edges: Sequence[Edge], around: Around) -> list[Edge]:
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


def _offsets(edges: list[Edge]) -> tuple[list[tuple[np.ndarray, np.ndarray]], list[Edge]]:
    """Where the outer ends (3,) of edges lie, and the edges left: what is too short for its mitres is left out."""
    while True:
        if len(edges) > MOST:
            return [], []
        ends = []
        for i, edge in enumerate(edges):
            ahead = edge.after
            if ahead >= 0 and not _meet(edge, edges[ahead]):
                edges[i], edges[ahead] = edge._replace(after=-1), edges[ahead]._replace(before=-1)
        for edge in edges:
            left = _outer(edge, edges[edge.before] if edge.before >= 0 else None, edge.start)
            right = _outer(edge, edges[edge.after] if edge.after >= 0 else None, edge.end)
            ends.append((left, right))
        short = [(right - left)[:2] @ edge.ahead < TOUCH_M for edge, (left, right) in zip(edges, ends, strict=True)]
        if not any(short):
            return ends, edges
        number = np.cumsum([0, *(not one for one in short)])

        def kept(other: int, short: list[bool] = short, number: np.ndarray = number) -> int:
            return -1 if other < 0 or short[other] else int(number[other])

        edges = [
            edge._replace(before=kept(edge.before), after=kept(edge.after))
            for edge, out in zip(edges, short, strict=True)
            if not out
        ]


def _meet(one: Edge, other: Edge) -> bool:
    """Whether overhangs of two edges meet in a mitre: near enough, and at one height."""
    step = _mitre(one, other)
    if step is None:
        return False
    return bool(abs(_lowered(one, one.end, step)[2] - _lowered(other, other.start, step)[2]) < LEVEL_M)


def _mitre(one: Edge, other: Edge) -> np.ndarray | None:
    """From where two edges meet to where their outer edges do, (2,); None where that is too far."""
    system = np.array([one.out, other.out])
    if abs(np.linalg.det(system)) < 0.05:
        return (one.out * (one.wide + other.wide) / 2) if one.out @ other.out > 0 else None
    found = np.linalg.solve(system, [one.wide, other.wide])
    return found if np.hypot(*found) <= MITRE * max(abs(one.wide), abs(other.wide)) else None


def _outer(edge: Edge, other: Edge | None, corner: np.ndarray) -> np.ndarray:
    """The outer corner (3,) over a corner of an edge, which the other edge shares."""
    if other is None:
        return _lowered(edge, corner, edge.wide * edge.out)
    step = _mitre(edge, other)
    assert step is not None
    return (_lowered(edge, corner, step) + _lowered(other, corner, step)) / 2


def _lowered(edge: Edge, corner: np.ndarray, step: np.ndarray) -> np.ndarray:
    """A corner of an edge, gone a step (2,) on the plane of its overhang."""
    run = edge.end - edge.start
    climb = run[2] / np.hypot(*run[:2])
    return corner + np.array([*step, climb * (step @ edge.ahead) - edge.lower * (step @ edge.out)])


def _normal(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    normal = np.cross(b - a, c - a)
    return normal / np.linalg.norm(normal)


def _with_strips(roof: Facets, strips: np.ndarray, facet: np.ndarray, normals: np.ndarray) -> Facets:
    """A roof's facets with quads (q, 4, 3) of facets (q,), those beyond its own new."""
    corner = len(roof.vertices) + np.arange(4 * len(strips)).reshape(-1, 4)
    triangles = np.concatenate([roof.triangles, corner[:, [0, 1, 2]], corner[:, [0, 2, 3]]])
    of = np.concatenate([roof.facet, facet, facet])
    order = np.argsort(of, kind="stable")
    more = len(triangles) - len(roof.triangles)
    return Facets(
        vertices=np.concatenate([roof.vertices, strips.reshape(-1, 3)]),
        triangles=triangles[order],
        facet=of[order],
        texture=np.concatenate([roof.texture, np.full(more, -1, np.int32)])[order],
        uv=np.concatenate([roof.uv, np.zeros((more, 3, 2), np.float32)])[order],
        kind=np.concatenate([roof.kind, np.full(len(normals) - len(roof.kind), ROOF, np.uint8)]),
        normal=normals,
    )


class Faces:
    """Collects planar polygons, a facet each."""

    def __init__(self) -> None:
        self._kinds: list[int] = []
        self._corners: list[list[np.ndarray]] = []

    def add(self, kind: int, corners: list[np.ndarray]) -> None:
        """corners: three or more (3,), convex, counter-clockwise seen from outside, the first two along the chart's right."""
        self._kinds.append(kind)
        self._corners.append(corners)

    def trim(self) -> Trim:
        """The longest first: those that follow share its chunks."""
        order = np.argsort([-np.linalg.norm(own[1] - own[0]) for own in self._corners], kind="stable")
        kinds, faces = np.array(self._kinds, np.uint8)[order], [self._corners[i] for i in order]
        first = np.cumsum([0, *map(len, faces)])
        fans = [[(0, k, k + 1) for k in range(1, len(own) - 1)] for own in faces]
        triangles = np.concatenate([np.array(fan) + start for fan, start in zip(fans, first[:-1], strict=True)])
        normal = np.array([_normal(own[0], own[1], own[2]) for own in faces])
        along = np.array([own[1] - own[0] for own in faces])
        count = len(triangles)
        found = Facets(
            vertices=np.concatenate([np.array(own) for own in faces]),
            triangles=triangles,
            facet=np.repeat(np.arange(len(fans)), list(map(len, fans))),
            texture=np.full(count, -1, np.int32),
            uv=np.zeros((count, 3, 2), np.float32),
            kind=kinds,
            normal=normal,
        )
        return Trim(found, along / np.linalg.norm(along, axis=1, keepdims=True))
