"""Facets into charts; modelled shells down to the ground, and no farther."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from facade_core.core.types import Shell
from facade_core.geometry.buildings.facets import Facets
from facade_core.geometry.charts import ChartKind, Pieces, frames
from facade_core.geometry.cutting import SHORTEST_WALL_M, cut_triangles
from facade_core.geometry.ground.terrain import Terrain
from facade_core.geometry.neighbours import OUTLINE_M

# A gap of this much between a building and the terrain below it is closed by a wall.
SKIRT_M = 0.05
# The lower edges of a shell's walls lie near its lowest point.
FOOT_M = 2.0
# A shell that goes so far into the ground begins there, if so much of it is above.
SUNK_M, ABOVE_M = 0.5, 2.5


def from_the_ground(shell: Shell, lowest: float) -> Shell:
    """A shell that begins below the lowest ground about it, metres, begun there instead: what lies deeper is lifted, so what is
    closed stays closed. There are models whose walls go down to height 0, metres below the ground that they state: storeys
    counted from there have their doors and shops in the earth. A shell with textures of its own stays as it is."""
    deep, height = shell.vertices[:, 2] < lowest, shell.vertices[:, 2] - lowest
    if not len(height) or height.min() > -SUNK_M or height.max() < ABOVE_M or (shell.texture >= 0).any():
        return shell
    vertices = shell.vertices.copy()
    vertices[deep, 2] = lowest
    return replace(shell, vertices=vertices)


def add_facets(
    pieces: Pieces, index: int, facets: Facets, largest: float, grid: float, along: np.ndarray | None = None
) -> None:
    """Facets as charts, with their right `along` (f, 3) if that is given; those longer than `max_chart_side` are cut on the grid."""
    axis_u, axis_v = frames(facets.normal) if along is None else (along, np.cross(along, facets.normal))
    vertices, triangles, uv = facets.vertices, facets.triangles, facets.uv
    corners = vertices[triangles]
    first = np.searchsorted(facets.facet, np.arange(len(facets)))
    long = np.zeros(len(facets), bool)
    for axis in (axis_u, axis_v):
        place = np.einsum("tcj,tj->tc", corners, axis[facets.facet])
        extent = np.maximum.reduceat(place.max(axis=1), first) - np.minimum.reduceat(place.min(axis=1), first)
        long |= extent > largest
    if not long.any():
        parts = [(facets.facet, np.zeros(len(triangles), np.int64), triangles, uv, facets.texture)]
    else:
        whole = ~long[facets.facet]
        parts = [
            (facets.facet[whole], np.zeros(whole.sum(), np.int64), triangles[whole], uv[whole], facets.texture[whole])
        ]
        for f in np.flatnonzero(long):
            mine = facets.facet == f
            vertices, cut, cut_uv, source, cell = cut_triangles(vertices, triangles[mine], uv[mine], grid)
            parts.append((np.full(len(cut), f), cell, cut, cut_uv, facets.texture[mine][source]))
    facet, cell, triangles, uv, texture = (np.concatenate(column) for column in zip(*parts, strict=True))
    surface, chart = np.unique(facet * (cell.max() + 1) + cell, return_inverse=True)
    surface //= cell.max() + 1
    order = np.argsort(chart, kind="stable")
    pieces.add(
        facets.kind[surface], surface, index, axis_u[surface], axis_v[surface],
        vertices, triangles[order], chart[order], texture[order], uv[order],
    )  # fmt: skip


def add_skirt(
    pieces: Pieces,
    index: int,
    facets: Facets,
    outline: Polygon | MultiPolygon,
    terrain: Terrain,
    largest: float,
    grid: float,
) -> None:
    """Walls from the open lower edges of a shell's walls down to the terrain, one surface per facet."""
    edges = np.concatenate([facets.triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    key = np.sort(edges, axis=1) @ [len(facets.vertices), 1]
    _, of, uses = np.unique(key, return_inverse=True, return_counts=True)
    facet = np.tile(facets.facet, 3)
    ends = facets.vertices[edges]
    gap = ends[..., 2] - terrain.height(ends.reshape(-1, 3)[:, :2]).reshape(-1, 2)
    run = np.hypot(*(ends[:, 1] - ends[:, 0])[:, :2].T)
    # counter-clockwise seen from outside, the lower edge of a wall runs to the right
    right = np.einsum("ij,ij->i", (ends[:, 1] - ends[:, 0])[:, :2], frames(facets.normal)[0][facet][:, :2])
    foot = (
        (uses[of] == 1)
        & (np.abs(facets.normal[facet, 2]) < 0.5)
        & (right > 0.5 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))
        & (ends[..., 2].max(axis=1) < facets.vertices[:, 2].min() + FOOT_M)
        & (gap.max(axis=1) > SKIRT_M)
        & (run > SHORTEST_WALL_M)
    )
    foot &= shapely.distance(outline.boundary, shapely.points(ends.mean(axis=1)[:, :2])) < OUTLINE_M
    if not foot.any():
        return
    a, b = ends[foot, 0], ends[foot, 1]
    drop = np.maximum(gap[foot], 0)
    for share in (0.25, 0.5, 0.75):  # uneven ground lies lower than its ends somewhere between
        between = a + share * (b - a) - np.array([0, 0, 1]) * (drop @ [1 - share, share])[:, None]
        drop += np.maximum(between[:, 2] - terrain.height(between[:, :2]), 0)[:, None]
    low = [p - drop[:, k : k + 1] * [0, 0, 1] for k, p in enumerate((a, b))]
    order = np.argsort(facet[foot], kind="stable")
    of_facet, chart = np.unique(facet[foot][order], return_inverse=True)
    normal = facets.normal[of_facet] * [1, 1, 0]
    n = len(order)
    quads = np.stack([order + k * n for k in (2, 3, 1, 2, 1, 0)], axis=1)
    skirt = Facets(
        vertices=np.concatenate([a, b, *low]),
        triangles=quads.reshape(-1, 3),
        facet=np.repeat(chart, 2),
        texture=np.full(2 * n, -1, np.int32),
        uv=np.zeros((2 * n, 3, 2), np.float32),
        kind=np.full(len(of_facet), ChartKind.WALL, np.uint8),
        normal=normal / np.linalg.norm(normal, axis=1, keepdims=True),
    )
    add_facets(pieces, index, skirt, largest, grid)
