"""Overhangs of pitched roofs, and parapets of flat roofs, at edges without a neighbour.

They are installations outside the closed surface of the building, which walls and roof form without them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from shapely import Polygon

from facade_core.core.arrays import Float64Array, Int64Array
from facade_core.core.fixed_order import dot_product
from facade_core.geometry.buildings.facets import Facets
from facade_core.geometry.buildings.roof_details import RoofDetail, RoofDetailBuilder, triangle_normal
from facade_core.geometry.buildings.roof_edges import (
    OPEN_SURROUNDINGS,
    RoofEdge,
    RoofSurroundings,
    cut_free_roof_edges,
    roof_edges,
)
from facade_core.geometry.buildings.settings import EAVES, ROOF_EDGES
from facade_core.geometry.charts import ChartKind


class Overhang(NamedTuple):
    """Pitched roof extended over its edges.

    Attributes
    ----------
    roof : facets with the overhang.
    coves : sloped surfaces below the overhang; None without any.
    edges : extended edges.
    ends : outer ends (3,) of each edge.
    below : metres from an edge down to the foot of its cove.
    """

    roof: Facets
    coves: RoofDetail | None
    edges: list[RoofEdge]
    ends: list[tuple[Float64Array, Float64Array]]
    below: float


def build_overhang(roof: Facets, outline: Polygon, surroundings: RoofSurroundings) -> Overhang:
    """Extend a pitched roof over its eaves and verges; edges with a neighbour stay as they are.

    Parameters
    ----------
    roof : facets of the roof.
    outline : footprint of the building.
    surroundings : surroundings of the roof's edges.
    """
    offsets, edges = _outer_ends(
        cut_free_roof_edges([_set_width(edge) for edge in roof_edges(roof, outline)], surroundings)
    )
    if not edges:
        return Overhang(roof, None, [], [], 0.0)
    faces = RoofDetailBuilder()
    strips, facet, normals = [], [], list(roof.normal)
    level: dict[tuple[int, float], int] = {}
    # the same for all edges, so that coves meet at corners
    below = np.array([0.0, 0.0, max(edge.width * _overhang_slope(edge) for edge in edges) + EAVES.cove_depth_m])
    for edge, (left, right) in zip(edges, offsets, strict=True):
        strips.append([edge.start, left, right, edge.end])
        if edge.slope > EAVES.max_overhang_slope:
            # at a kink the strip is in its own plane
            way = (edge.facet, round(float(np.arctan2(*edge.outward)), 3))
            facet.append(level.setdefault(way, len(normals)))
            if facet[-1] == len(normals):
                normals.append(triangle_normal(*strips[-1][:3]))
        else:
            facet.append(edge.facet)
        faces.add_polygon(ChartKind.CEILING, [edge.start - below, edge.end - below, right, left])
        if edge.previous < 0:
            faces.add_polygon(ChartKind.WALL, [edge.start - below, left, edge.start])
        if edge.following < 0:
            faces.add_polygon(ChartKind.WALL, [right, edge.end - below, edge.end])
    drawn = _append_strips(roof, np.array(strips), np.array(facet), np.array(normals))
    return Overhang(drawn, faces.build(), edges, offsets, float(below[2]))


def build_parapet(outline: Polygon, top: float, surroundings: RoofSurroundings) -> RoofDetail | None:
    """Build a low wall, with a top sloped inwards, along the free edges of a flat roof.

    Parameters
    ----------
    outline : footprint of the building.
    top : height of the roof in metres.
    surroundings : surroundings of the roof's edges.

    Returns
    -------
    None where neighbours surround the roof.
    """
    edges: list[RoofEdge] = []
    for ring in (outline.exterior, *outline.interiors):
        corners = np.column_stack([np.asarray(ring.coords), np.full(len(ring.coords), top)])
        first, count = len(edges), len(corners) - 1
        for k in range(count):
            before, after = first + (k - 1) % count, first + (k + 1) % count
            edges.append(RoofEdge(corners[k], corners[k + 1], -1, 0.0, -EAVES.coping_m, before, after))
    offsets, edges = _outer_ends(
        cut_free_roof_edges(edges, surroundings._replace(street_points=OPEN_SURROUNDINGS.street_points))
    )
    if not edges:
        return None
    faces = RoofDetailBuilder()
    high = np.array([0.0, 0.0, EAVES.parapet_m])
    for edge, (left, right) in zip(edges, offsets, strict=True):
        faces.add_polygon(ChartKind.WALL, [edge.start, edge.end, edge.end + high, edge.start + high])
        faces.add_polygon(ChartKind.ROOF, [edge.start + high, edge.end + high, right, left])
        if edge.previous < 0:
            faces.add_polygon(ChartKind.WALL, [left, edge.start, edge.start + high])
        if edge.following < 0:
            faces.add_polygon(ChartKind.WALL, [edge.end, right, edge.end + high])
    return faces.build()


def _set_width(edge: RoofEdge) -> RoofEdge:
    """Return an edge with the width of its overhang."""
    sloped = abs(edge.end[2] - edge.start[2]) > 0.1 * np.hypot(*(edge.end - edge.start)[:2])
    if sloped or edge.slope <= 0:
        return edge._replace(width=EAVES.verge_m)
    return edge._replace(
        width=min(EAVES.overhang_m, EAVES.max_drop_m / edge.slope)
        if edge.slope <= EAVES.max_overhang_slope
        else EAVES.overhang_m
    )


def _overhang_slope(edge: RoofEdge) -> float:
    """Return the fall of an edge's overhang per metre outwards."""
    return EAVES.steep_overhang_slope if edge.slope > EAVES.max_overhang_slope else edge.slope


def _outer_ends(edges: list[RoofEdge]) -> tuple[list[tuple[Float64Array, Float64Array]], list[RoofEdge]]:
    """Compute the outer ends (3,) of edges; edges too short for their mitres are dropped."""
    while True:
        if len(edges) > EAVES.max_edges:
            return [], []
        ends = []
        for i, edge in enumerate(edges):
            ahead = edge.following
            if ahead >= 0 and not _is_mitred(edge, edges[ahead]):
                edges[i], edges[ahead] = edge._replace(following=-1), edges[ahead]._replace(previous=-1)
        for edge in edges:
            left = _outer_corner(edge, edges[edge.previous] if edge.previous >= 0 else None, edge.start)
            right = _outer_corner(edge, edges[edge.following] if edge.following >= 0 else None, edge.end)
            ends.append((left, right))
        short = [
            bool(dot_product((right - left)[:2], edge.direction) < ROOF_EDGES.max_touch_m)
            for edge, (left, right) in zip(edges, ends, strict=True)
        ]
        if not any(short):
            return ends, edges
        number = np.cumsum([0, *(not one for one in short)])

        def renumber(other: int, short: list[bool] = short, number: Int64Array = number) -> int:
            return -1 if other < 0 or short[other] else int(number[other])

        edges = [
            edge._replace(previous=renumber(edge.previous), following=renumber(edge.following))
            for edge, out in zip(edges, short, strict=True)
            if not out
        ]


def _is_mitred(one: RoofEdge, other: RoofEdge) -> bool:
    """Return whether the overhangs of two edges meet in a mitre of one height."""
    step = mitre_offset(one, other)
    if step is None:
        return False
    return bool(
        abs(_step_outwards(one, one.end, step)[2] - _step_outwards(other, other.start, step)[2]) < EAVES.mitre_level_m
    )


def mitre_offset(one: RoofEdge, other: RoofEdge) -> Float64Array | None:
    """Return the offset (2,) from the corner of two edges to the corner of their outer edges; None where it is too long."""
    system = np.array([one.outward, other.outward])
    (a, b), (c, d) = system
    determinant = a * d - b * c
    if abs(determinant) < 0.05:
        return (one.outward * (one.width + other.width) / 2) if dot_product(one.outward, other.outward) > 0 else None
    found = np.array([d * one.width - b * other.width, a * other.width - c * one.width]) / determinant
    return found if np.hypot(*found) <= EAVES.max_mitre_ratio * max(abs(one.width), abs(other.width)) else None


def _outer_corner(edge: RoofEdge, other: RoofEdge | None, corner: Float64Array) -> Float64Array:
    """Return the outer corner (3,) at a corner of an edge, shared with `other`."""
    if other is None:
        return _step_outwards(edge, corner, edge.width * edge.outward)
    step = mitre_offset(edge, other)
    assert step is not None
    return (_step_outwards(edge, corner, step) + _step_outwards(other, corner, step)) / 2


def _step_outwards(edge: RoofEdge, corner: Float64Array, step: Float64Array) -> Float64Array:
    """Return a corner of an edge moved by a step (2,) on the plane of its overhang."""
    run = edge.end - edge.start
    climb = run[2] / np.hypot(*run[:2])
    outer: Float64Array = corner + np.array(
        [
            *step,
            climb * dot_product(step, edge.direction) - _overhang_slope(edge) * dot_product(step, edge.outward),
        ]
    )
    return outer


def _append_strips(roof: Facets, strips: Float64Array, facet: Int64Array, normals: Float64Array) -> Facets:
    """Append quads (q, 4, 3) of facets (q,) to a roof; facet numbers beyond the roof's are new facets."""
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
