"""Vents on roofs whose shape is assumed: cowls over pipes on slopes, boxes on flat roofs, where a street sees them."""

from __future__ import annotations

from hashlib import blake2b
from typing import NamedTuple

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from facade_core.geometry.buildings.eaves import PARAPET_M
from facade_core.geometry.buildings.facets import Facets
from facade_core.geometry.buildings.roof_details import Faces, Trim
from facade_core.geometry.buildings.roof_edges import SEEN_M, Around, Edge, free_pieces, roof_edges
from facade_core.geometry.charts import ChartKind

# This share of roofs has vents, so many at most, and one for so many metres of edge.
SHARE, MOST, EVERY_M = 0.7, 4, 7.0
# Slopes of pitched roofs that carry some, metres a metre.
FALLS = (0.12, 1.2)
# So far from an edge's ends, with nothing nearer than the second figure; eyes are so high over the ground.
ASIDE_M, CLEAR_M, EYES_M = 0.8, 0.25, 1.6
# They begin so far below the lowest place of the roof around them.
SUNK_M = 0.04
# It is in sight where what is over this share of its height is.
TOP = 0.8


class Size(NamedTuple):
    """Half of a vent's width; from and to which height it stands over the roof at its middle, how far behind the edge."""

    half: float
    high: tuple[float, float]
    behind: tuple[float, float]


COWL, BOX = Size(0.075, (0.4, 0.65), (0.9, 3.2)), Size(0.32, (0.9, 1.3), (0.8, 1.8))


def vents(
    id: str, roof: Facets, outline: Polygon, around: Around, high: float, taken: list[Trim | None]
) -> Trim | None:
    """The vents on the facets of a pitched roof, beside what is `taken`; None without any. A vent has 10 triangles.

    high: how far the eaves are over the ground, metres.
    """
    edges = [edge for edge in roof_edges(roof, outline) if abs(edge.end[2] - edge.start[2]) < 0.02]
    edges = free_pieces([edge for edge in edges if FALLS[0] < edge.fall < FALLS[1]], around)
    blocked = shapely.union_all([place.buffer(CLEAR_M) for trim in taken if trim for place in _places(trim.facets)])
    room = {}
    for facet in {edge.facet for edge in edges}:
        mine = roof.vertices[roof.triangles[roof.facet == facet]]
        room[facet] = shapely.union_all(shapely.polygons(mine[..., :2])).difference(blocked)
    return _placed(id, edges, [room[edge.facet] for edge in edges], around, high, COWL)


def vents_on_flat(id: str, outline: Polygon, top: float, around: Around, high: float) -> Trim | None:
    """The vents on a flat roof at height `top` with a parapet, as those on a pitched one."""
    ring = np.asarray(shapely.orient_polygons(outline).exterior.coords)
    corners = np.column_stack([ring, np.full(len(ring), top)])
    edges = free_pieces([Edge(a, b, -1, 0.0, 0.0) for a, b in zip(corners[:-1], corners[1:], strict=True)], around)
    return _placed(id, edges, [outline] * len(edges), around, high, BOX)


def _placed(
    id: str, edges: list[Edge], room: list[Polygon | BaseGeometry], around: Around, high: float, size: Size
) -> Trim | None:
    """Vents behind edges, within what is free there (from above), as the building's id puts them."""
    seed = blake2b(id.encode(errors="surrogatepass"), digest_size=8, person=b"vents").digest()
    rng = np.random.default_rng(int.from_bytes(seed))
    if rng.random() > SHARE:
        return None
    faces, built = Faces(), 0
    for edge, free in zip(edges, room, strict=True):
        length = float(np.hypot(*(edge.end - edge.start)[:2]))
        for _ in range(int(length / EVERY_M)):
            share, *drawn = rng.random(3)
            rise, behind = (low + part * (most - low) for part, (low, most) in zip(drawn, size[1:], strict=True))
            middle = edge.start[:2] + (ASIDE_M + share * (length - 2 * ASIDE_M)) * edge.ahead - behind * edge.out
            if built == MOST or not _in_sight(edge, middle, behind, rise, around, high):
                continue
            square = shapely.box(*(middle - size.half), *(middle + size.half)).buffer(size.half)
            if free.contains(square):
                _build(faces, edge, middle, behind, rise, size.half)
                free, built = free.difference(square.buffer(1.0)), built + 1
    return faces.trim() if built else None


def _in_sight(edge: Edge, middle: np.ndarray, behind: float, rise: float, around: Around, high: float) -> bool:
    """Whether the top of a vent is seen over the roof's edge from some place on a street in front."""
    if not len(around.eyes):
        return True
    away = (around.eyes - middle) @ edge.out - behind
    near = away[(away > 1.0) & (np.hypot(*(around.eyes - middle).T) < SEEN_M)]
    lip = 0.0 if edge.fall else PARAPET_M
    seen = behind * edge.fall + TOP * rise - lip
    return bool(((high + lip - EYES_M) * behind < seen * near).any())


def _build(faces: Faces, edge: Edge, middle: np.ndarray, behind: float, rise: float, half: float) -> None:
    """A vent, two of its sides on a chart each."""
    ahead, out = half * np.append(edge.ahead, 0.0), half * np.append(edge.out, 0.0)
    level = edge.start[2] + behind * edge.fall
    foot = np.append(middle, level - half * edge.fall - SUNK_M)
    top = np.append(middle, level + rise)
    turns = (out - ahead, out + ahead, ahead - out, -ahead - out)  # counter-clockwise from above
    for k in (0, 2):
        left, corner, right = turns[k], turns[(k + 1) % 4], turns[(k + 2) % 4]
        sides = [[foot + one, foot + other, top + other, top + one] for one, other in ((left, corner), (corner, right))]
        faces.bend(ChartKind.METAL, sides, right - left)
    faces.add(ChartKind.METAL, [top + turn for turn in turns])


def _places(facets: Facets) -> list[BaseGeometry]:
    """What facets cover from above, each."""
    return [
        shapely.multipoints(facets.vertices[np.unique(facets.triangles[facets.facet == facet]), :2]).convex_hull
        for facet in range(len(facets))
    ]
