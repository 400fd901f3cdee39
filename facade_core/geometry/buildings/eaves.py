"""What stands out at a roof's edge where no neighbour does: eaves and verges of pitched roofs, parapets of flat ones.

They are drawn beside the building's closed surfaces, as installations on it: walls and roofs end where they would without.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from shapely import Polygon

from facade_core.geometry.buildings.facets import Facets
from facade_core.geometry.buildings.roof_details import Faces, Trim, normal_of
from facade_core.geometry.buildings.roof_edges import OPEN, TOUCH_M, Around, Edge, free_pieces, roof_edges
from facade_core.geometry.charts import ChartKind

# How far a roof reaches beyond a wall below its eaves, and beyond a gable; how far below the edge its cove meets the wall.
OVERHANG_M, VERGE_M, THICK_M = 0.4, 0.2, 0.22
# It ends no lower than this under the eaves; one steeper than the second figure runs out as flat as the third (slopes).
LOWER_M, STEEP, FLAT = 0.3, 1.0, 0.2
# A parapet, over a roof that is higher than the third figure: lower ones have none.
PARAPET_M, COPING_M, LOW_ROOF_M = 0.4, 0.3, 4.0
# A roof with more edges is round, and has none of this.
MOST = 48
# Edges meet in a mitre up to this many times as long as they are wide.
MITRE = 2.5
# And where their heights there differ by less than this.
LEVEL_M = 5e-3


class Overhang(NamedTuple):
    """A pitched roof drawn out over its edges; the coves below, None without any; its edges as far as they are drawn out, with
    the outer ends (3,) of each; how far below an edge its cove meets the wall, metres."""

    roof: Facets
    coves: Trim | None
    edges: list[Edge]
    ends: list[tuple[np.ndarray, np.ndarray]]
    below: float


def overhang(roof: Facets, outline: Polygon, around: Around) -> Overhang:
    """The facets of a pitched roof drawn out over its eaves and verges; the roof as it is where there is nowhere to."""
    offsets, edges = _offsets(free_pieces([_with_width(edge) for edge in roof_edges(roof, outline)], around))
    if not edges:
        return Overhang(roof, None, [], [], 0.0)
    faces = Faces()
    strips, facet, normals = [], [], list(roof.normal)
    level: dict[tuple[int, float], int] = {}
    # one for all, so that coves meet at corners
    below = np.array([0.0, 0.0, max(edge.wide * _lower(edge) for edge in edges) + THICK_M])
    for edge, (left, right) in zip(edges, offsets, strict=True):
        strips.append([edge.start, left, right, edge.end])
        if edge.fall > STEEP:
            # a kink: the strip lies in a plane of its own
            way = (edge.facet, round(float(np.arctan2(*edge.out)), 3))
            facet.append(level.setdefault(way, len(normals)))
            if facet[-1] == len(normals):
                normals.append(normal_of(*strips[-1][:3]))
        else:
            facet.append(edge.facet)
        faces.add(ChartKind.CEILING, [edge.start - below, edge.end - below, right, left])
        if edge.before < 0:
            faces.add(ChartKind.WALL, [edge.start - below, left, edge.start])
        if edge.after < 0:
            faces.add(ChartKind.WALL, [right, edge.end - below, edge.end])
    drawn = _with_strips(roof, np.array(strips), np.array(facet), np.array(normals))
    return Overhang(drawn, faces.trim(), edges, offsets, float(below[2]))


def parapet(outline: Polygon, top: float, around: Around) -> Trim | None:
    """A low wall along the edges of a flat roof at height `top`, which slopes inwards; None where neighbours are all around."""
    edges: list[Edge] = []
    for ring in (outline.exterior, *outline.interiors):
        corners = np.column_stack([np.asarray(ring.coords), np.full(len(ring.coords), top)])
        first, count = len(edges), len(corners) - 1
        for k in range(count):
            before, after = first + (k - 1) % count, first + (k + 1) % count
            edges.append(Edge(corners[k], corners[k + 1], -1, 0.0, -COPING_M, before, after))
    offsets, edges = _offsets(free_pieces(edges, around._replace(eyes=OPEN.eyes)))
    if not edges:
        return None
    faces = Faces()
    high = np.array([0.0, 0.0, PARAPET_M])
    for edge, (left, right) in zip(edges, offsets, strict=True):
        faces.add(ChartKind.WALL, [edge.start, edge.end, edge.end + high, edge.start + high])
        faces.add(ChartKind.ROOF, [edge.start + high, edge.end + high, right, left])
        if edge.before < 0:
            faces.add(ChartKind.WALL, [left, edge.start, edge.start + high])
        if edge.after < 0:
            faces.add(ChartKind.WALL, [edge.end, right, edge.end + high])
    return faces.trim()


def _with_width(edge: Edge) -> Edge:
    """An edge of a roof with the width of its overhang."""
    sloped = abs(edge.end[2] - edge.start[2]) > 0.1 * np.hypot(*(edge.end - edge.start)[:2])
    if sloped or edge.fall <= 0:
        return edge._replace(wide=VERGE_M)
    return edge._replace(wide=min(OVERHANG_M, LOWER_M / edge.fall) if edge.fall <= STEEP else OVERHANG_M)


def _lower(edge: Edge) -> float:
    """How far an edge's overhang falls per metre outwards."""
    return FLAT if edge.fall > STEEP else edge.fall


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
    step = mitre(one, other)
    if step is None:
        return False
    return bool(abs(_lowered(one, one.end, step)[2] - _lowered(other, other.start, step)[2]) < LEVEL_M)


def mitre(one: Edge, other: Edge) -> np.ndarray | None:
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
    step = mitre(edge, other)
    assert step is not None
    return (_lowered(edge, corner, step) + _lowered(other, corner, step)) / 2


def _lowered(edge: Edge, corner: np.ndarray, step: np.ndarray) -> np.ndarray:
    """A corner of an edge, gone a step (2,) on the plane of its overhang."""
    run = edge.end - edge.start
    climb = run[2] / np.hypot(*run[:2])
    return corner + np.array([*step, climb * (step @ edge.ahead) - _lower(edge) * (step @ edge.out)])


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
        kind=np.concatenate([roof.kind, np.full(len(normals) - len(roof.kind), ChartKind.ROOF, np.uint8)]),
        normal=normals,
    )
