"""Charts of facets, and contact of buildings with the ground."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from facade_core.core.arrays import Float64Array
from facade_core.core.fixed_order import multiply_matrices
from facade_core.core.types import Building, BuildingShell
from facade_core.geometry.buildings.facets import Facets
from facade_core.geometry.buildings.settings import FACETS, NEIGHBOURS, SHELLS
from facade_core.geometry.charts import ChartKind, SurfaceTarget, chart_axes_right_down
from facade_core.geometry.cutting import cut_triangles_on_grid
from facade_core.geometry.ground.terrain import Terrain, source_ground_height
from facade_core.geometry.settings import CUTTING


def lift_to_ground(shell: BuildingShell, lowest: float) -> BuildingShell:
    """Lift the part of a shell below the lowest ground around it to that height; closed shells stay closed.

    Some models extend down to height 0, metres below their stated ground, and floors would be counted from there.
    Shells with textures of their own stay unchanged.

    Parameters
    ----------
    lowest : height in metres of the lowest ground.
    """
    deep, height = shell.vertices[:, 2] < lowest, shell.vertices[:, 2] - lowest
    if (
        not len(height)
        or height.min() > -SHELLS.min_buried_m
        or height.max() < SHELLS.min_visible_m
        or (shell.texture >= 0).any()
    ):
        return shell
    vertices = shell.vertices.copy()
    vertices[deep, 2] = lowest
    return replace(shell, vertices=vertices)


def lower_to_ground(building: Building, outline: Polygon | MultiPolygon, terrain: Terrain) -> Building:
    """Lengthen the walls of a building that stands a little above its lowest ground down to it; the roof stays.

    Each wall then is one surface from the ground, with the layout of a whole wall. A strip below it would be bare. Raised
    buildings, those with passages, and shells with textures of their own stay unchanged.

    Parameters
    ----------
    outline : footprint of the building.
    terrain : ground heights.
    """
    shell = building.shell
    if building.raised or building.passages or (shell is not None and (shell.texture >= 0).any()):
        return building
    foot = source_ground_height(building if shell is None else replace(building, base=None))
    if foot is None:
        return building
    gap = foot - terrain.lowest_along(outline)
    if not SHELLS.min_skirt_m < gap <= SHELLS.max_lowered_m:
        return building
    if shell is None:
        return replace(building, base=foot - gap, height=building.height + gap)
    vertices = shell.vertices.copy()
    vertices[vertices[:, 2] < foot + FACETS.underside_m, 2] -= gap
    return replace(building, shell=replace(shell, vertices=vertices))


def add_facet_charts(target: SurfaceTarget, facets: Facets, along: Float64Array | None = None) -> None:
    """Add facets as charts, and cut long ones on the world grid.

    Parameters
    ----------
    target : place of the surfaces.
    along : (f, 3) right axes of the charts; default by `chart_axes_right_down`.
    """
    axis_u, axis_v = chart_axes_right_down(facets.normal) if along is None else (along, np.cross(along, facets.normal))
    vertices, triangles, uv = facets.vertices, facets.triangles, facets.uv
    corners = vertices[triangles]
    first = np.searchsorted(facets.facet, np.arange(len(facets)))
    long = np.zeros(len(facets), bool)
    for axis in (axis_u, axis_v):
        place = np.einsum("tcj,tj->tc", corners, axis[facets.facet])
        extent = np.maximum.reduceat(place.max(axis=1), first) - np.minimum.reduceat(place.min(axis=1), first)
        long |= extent > target.largest
    if not long.any():
        parts = [(facets.facet, np.zeros(len(triangles), np.int64), triangles, uv, facets.texture)]
    else:
        whole = ~long[facets.facet]
        parts = [
            (facets.facet[whole], np.zeros(whole.sum(), np.int64), triangles[whole], uv[whole], facets.texture[whole])
        ]
        for f in np.flatnonzero(long):
            mine = facets.facet == f
            vertices, cut, cut_uv, source, cell = cut_triangles_on_grid(
                vertices, triangles[mine], uv[mine], target.grid
            )
            parts.append((np.full(len(cut), f), cell, cut, cut_uv, facets.texture[mine][source]))
    facet, cell, triangles, uv, texture = (np.concatenate(column) for column in zip(*parts, strict=True))
    surface, chart = np.unique(facet * (cell.max() + 1) + cell, return_inverse=True)
    surface //= cell.max() + 1
    order = np.argsort(chart, kind="stable")
    target.pieces.add_surfaces(
        facets.kind[surface], surface, target.building, axis_u[surface], axis_v[surface],
        vertices, triangles[order], chart[order], texture[order], uv[order],
    )  # fmt: skip


def add_skirt_charts(target: SurfaceTarget, facets: Facets, outline: Polygon | MultiPolygon, terrain: Terrain) -> None:
    """Add wall charts from the open lower edges of a shell down to the terrain, one surface per facet.

    Parameters
    ----------
    target : place of the surfaces.
    outline : footprint of the building.
    terrain : ground heights.
    """
    edges = np.concatenate([facets.triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    key = np.sort(edges, axis=1) @ [len(facets.vertices), 1]
    _, of, uses = np.unique(key, return_inverse=True, return_counts=True)
    facet = np.tile(facets.facet, 3)
    ends = facets.vertices[edges]
    gap = ends[..., 2] - terrain.interpolate(ends.reshape(-1, 3)[:, :2]).reshape(-1, 2)
    run = np.hypot(*(ends[:, 1] - ends[:, 0])[:, :2].T)
    # counter-clockwise seen from outside, the lower edge of a wall runs to the right
    right = np.einsum(
        "ij,ij->i", (ends[:, 1] - ends[:, 0])[:, :2], chart_axes_right_down(facets.normal)[0][facet][:, :2]
    )
    foot = (
        (uses[of] == 1)
        & (np.abs(facets.normal[facet, 2]) < 0.5)
        & (right > 0.5 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))
        & (ends[..., 2].max(axis=1) < facets.vertices[:, 2].min() + SHELLS.max_foot_m)
        & (gap.max(axis=1) > SHELLS.min_skirt_m)
        & (run > CUTTING.min_wall_piece_m)
    )
    foot &= shapely.distance(outline.boundary, shapely.points(ends.mean(axis=1)[:, :2])) < NEIGHBOURS.neighbour_gap_m
    if not foot.any():
        return
    a, b = ends[foot, 0], ends[foot, 1]
    drop = np.maximum(gap[foot], 0)
    for share in (0.25, 0.5, 0.75):  # uneven ground may be lower between the ends
        between = a + share * (b - a) - np.array([0, 0, 1]) * multiply_matrices(drop, [1 - share, share])[:, None]
        drop += np.maximum(between[:, 2] - terrain.interpolate(between[:, :2]), 0)[:, None]
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
    add_facet_charts(target, skirt)
