"""Curtain walls below open edges: missing party walls, and plinths on slopes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from facade_core.core.arrays import Float64Array
from facade_core.export.bodies.patches import GRID_M, MAX_WELD_M, PolygonMesh, open_edges, weld_polygons

# Maximum distance of an edge's ends from a line, seen from above, metres.
MAX_OFF_LINE_M = 0.02

Edge = tuple[Float64Array, Float64Array]


def add_walls_below_edges(shell: PolygonMesh, origin: Float64Array) -> PolygonMesh:
    """Add walls from open edges down to the lowest corner of a shell.

    Between the top and the bottom edge of a hole there is no wall.

    Parameters
    ----------
    shell : the shell.
    origin : (3,) origin of the grid of corners, world metres.
    """
    used = sorted({c for patch in shell.patches for ring in patch.rings for c in ring})
    base = float(shell.points[used, 2].min())
    # the edge of the wall runs in the opposite direction
    edges = [(shell.points[b], shell.points[a]) for a, b in open_edges(shell.patches)]
    edges = [(a, b) for a, b in edges if max(a[2], b[2]) > base and np.hypot(*(b - a)[:2]) > MAX_WELD_M]
    polygons = [polygon for own in _group_collinear_edges(edges) for polygon in _curtain_polygons(own, base)]
    if not polygons:
        return shell
    before = [[shell.points[list(ring)] for ring in patch.rings] for patch in shell.patches]
    charts = [patch.chart for patch in shell.patches] + [-1] * len(polygons)
    semantics = [patch.semantic for patch in shell.patches] + [-1] * len(polygons)
    return weld_polygons([*before, *polygons], charts, semantics, origin)


def _group_collinear_edges(edges: Sequence[Edge]) -> list[list[Edge]]:
    """Group edges over one line seen from above, longest first."""
    lines: list[list[Edge]] = []
    for edge in sorted(edges, key=lambda edge: -float(np.hypot(*(edge[1] - edge[0])[:2]))):
        for own in lines:
            start, run = own[0][0][:2], (own[0][1] - own[0][0])[:2]
            across = np.array([-run[1], run[0]]) / np.hypot(*run)
            if all(abs((end[:2] - start) @ across) < MAX_OFF_LINE_M for end in edge):
                own.append(edge)
                break
        else:
            lines.append([edge])
    return lines


def _curtain_polygons(edges: Sequence[Edge], base: float) -> list[list[Float64Array]]:
    """Return the walls below edges over one line down to `base`; areas below edges of both directions cancel."""
    origin, along = edges[0][0][:2], (edges[0][1] - edges[0][0])[:2]
    along = along / np.hypot(*along)
    below: dict[bool, list[shapely.Polygon]] = {True: [], False: []}
    for start, end in edges:
        (x0, x1), (z0, z1) = ((p[:2] - origin) @ along for p in (start, end)), (start[2] - base, end[2] - base)
        if abs(x1 - x0) > GRID_M:
            below[x1 > x0].append(shapely.Polygon([(x0, z0), (x1, z1), (x1, 0.0), (x0, 0.0)]))
    walls = {way: shapely.union_all(own, grid_size=GRID_M) for way, own in below.items()}
    polygons = []
    for way in (True, False):
        for part in shapely.get_parts(shapely.difference(walls[way], walls[not way], grid_size=GRID_M)):
            if part.geom_type != "Polygon" or part.area < MAX_WELD_M**2:
                continue
            # the edge on top runs along the line where `way`: clockwise in its plane
            part = shapely.orient_polygons(part, exterior_cw=way)
            rings = [np.asarray(ring.coords)[:-1] for ring in (part.exterior, *part.interiors)]
            polygons.append([np.column_stack([origin + ring[:, :1] * along, base + ring[:, 1]]) for ring in rings])
    return polygons
