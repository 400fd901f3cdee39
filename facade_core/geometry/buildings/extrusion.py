"""Extrusion of footprints: walls, flat roofs, undersides and skirts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from facade_core.core.arrays import Float64Array
from facade_core.core.fixed_order import multiply_matrices
from facade_core.geometry.buildings.facets import Facets
from facade_core.geometry.buildings.passages import (
    PassageOpening,
    WallOpening,
    passage_sides,
    polygon_edges,
    standing_outline,
    wall_openings,
)
from facade_core.geometry.buildings.settings import ROOF_SHAPES, SHELLS
from facade_core.geometry.buildings.shells import add_facet_charts
from facade_core.geometry.charts import ChartKind, SurfaceTarget
from facade_core.geometry.cutting import grid_crossings
from facade_core.geometry.ground.ground_charts import add_horizontal_surface, add_planar_chart
from facade_core.geometry.ground.settings import GROUND_CHARTS
from facade_core.geometry.ground.terrain import Terrain
from facade_core.geometry.settings import CUTTING

_DOWN = np.array([0.0, 0.0, -1.0])


class Extrusion(NamedTuple):
    """Footprint and heights of an extruded building.

    Attributes
    ----------
    outline : footprint.
    base : ground height in metres.
    height : metres from `base` to the eaves.
    raised : metres from `base` to the underside.
    openings : passages.
    """

    outline: Polygon
    base: float
    height: float
    raised: float = 0.0
    openings: Sequence[PassageOpening] = ()


def add_extrusion_charts(
    target: SurfaceTarget, extrusion: Extrusion, terrain: Terrain, roof: Facets | None = None
) -> None:
    """Add the charts of an extruded footprint: walls, roof, a skirt or an underside, and the insides of passages.

    Parameters
    ----------
    target : place of the surfaces.
    extrusion : footprint and heights.
    terrain : ground heights.
    roof : facets of a pitched roof; None for a flat one.
    """
    outline, base, height, raised, openings = extrusion
    foot, eaves = base + raised, base + height
    openings = [opening for opening in openings if opening.ceiling > foot]
    standing = standing_outline(outline, openings)
    joints = np.empty((0, 2)) if roof is None else roof.vertices[roof.vertices[:, 2] >= eaves, :2]
    edges = polygon_edges(outline)
    for a, b in edges:
        _add_wall(target, a, b, foot, eaves, joints, wall_openings(a, b, openings))
    if roof is None:
        add_horizontal_surface(target, ChartKind.ROOF, outline, eaves)
    if raised > 0:
        for part in shapely.get_parts(standing).tolist():
            add_horizontal_surface(target, ChartKind.CEILING, part, foot)
    else:
        _add_skirt_walls(target, polygon_edges(standing) if openings else edges, base, terrain)
    if roof is not None:
        add_facet_charts(target, roof)
    for opening in openings:
        for a, b in passage_sides(outline, opening):
            _add_wall(target, a, b, foot, opening.ceiling)
        add_horizontal_surface(target, ChartKind.CEILING, opening.area, opening.ceiling)


def _add_skirt_walls(
    target: SurfaceTarget, edges: Sequence[tuple[Float64Array, Float64Array]], base: float, terrain: Terrain
) -> None:
    for a, b in edges:
        length = float(np.hypot(*(b - a)))
        steps = grid_crossings(a, b, length, target.grid / GROUND_CHARTS.grid_divisors[-1]) / max(
            length, CUTTING.min_wall_piece_m
        )
        foot = float(terrain.interpolate(a + steps[:, None] * (b - a)).min())
        if base - foot > SHELLS.min_skirt_m:
            _add_wall(target, a, b, foot, base)


def facets_entirely_above(found: Facets, height: float) -> Facets:
    """Return the facets whose lowest vertex is above a height in metres."""
    low = np.full(len(found), np.inf)
    np.minimum.at(low, found.facet, found.vertices[found.triangles][..., 2].min(axis=1))
    kept = low > height - ROOF_SHAPES.grid_m
    mine = kept[found.facet]
    return replace(
        found,
        triangles=found.triangles[mine],
        facet=(np.cumsum(kept) - 1)[found.facet[mine]],
        texture=found.texture[mine],
        uv=found.uv[mine],
        kind=found.kind[kept],
        normal=found.normal[kept],
    )


def _add_wall(
    target: SurfaceTarget,
    a: Float64Array,
    b: Float64Array,
    low: float,
    high: float,
    joints: Float64Array | None = None,
    openings: Sequence[WallOpening] = (),
) -> None:
    """Add the wall over an edge with the building on its left, so that it runs left to right seen from outside.

    `joints` (k, 2) are corners of the roof; the wall gets a vertex at those on its edge. `openings` are cut out.
    """
    grid = target.grid
    length, height = float(np.hypot(*(b - a))), high - low
    if length < CUTTING.min_wall_piece_m:
        return
    along = np.append((b - a) / length, 0.0)
    cuts = grid_crossings(a, b, length, grid) if length > target.largest else np.array([0.0, length])
    levels = np.arange(0.0, height, grid) if height > target.largest else np.array([0.0])
    levels = np.append(levels, height)
    steps = np.empty(0) if joints is None else _distances_on_edge(a, along[:2], length, joints)
    for left, right in zip(cuts[:-1], cuts[1:], strict=True):
        for bottom, top in zip(levels[:-1], levels[1:], strict=True):
            origin = np.array([a[0], a[1], low + top]) + left * along
            met = steps[(steps > left) & (steps < right)] - left if top == height else steps[:0]
            holes = [
                shapely.box(one.left - left, low + top - one.top, one.right - left, top - bottom)
                for one in openings
                if one.left < right and one.right > left and one.top > low + bottom
            ]
            if holes:
                shape = shapely.box(0, 0, right - left, top - bottom).difference(shapely.union_all(holes))
                _add_opened_wall(target, origin, along, shape, met)
            else:
                _add_rectangle(target, origin, along, right - left, top - bottom, met)
    target.pieces.surface_count += 1


def _add_rectangle(
    target: SurfaceTarget,
    origin: Float64Array,
    along: Float64Array,
    width: float,
    height: float,
    met: Float64Array,
) -> None:
    """Add a chart of a wall with extra vertices at `met` (k,) metres from the left on its upper edge."""
    if not len(met):
        add_planar_chart(target, ChartKind.WALL, (origin, along, _DOWN), shapely.box(0, 0, width, height))
        return
    pieces = target.pieces
    x = np.concatenate([[0.0, width, width], met[::-1], [0.0]])
    y = np.concatenate([[height, height], np.zeros(len(met) + 2)])
    fan = np.arange(1, len(x) - 1)
    triangles = np.column_stack([np.zeros(len(fan), np.int64), fan, fan + 1])
    one = [
        np.array([value])
        for value in (ChartKind.WALL, pieces.surface_count, target.building, origin, along, _DOWN, (width, height))
    ]
    vertices = origin + x[:, None] * along + y[:, None] * _DOWN
    pieces.add_charts(tuple(one), (vertices, triangles, np.zeros(len(fan), np.int64), np.zeros(len(x), np.int64)))


def _add_opened_wall(
    target: SurfaceTarget, origin: Float64Array, along: Float64Array, shape: BaseGeometry, met: Float64Array
) -> None:
    """Add a chart for each polygon of a wall with openings, with extra vertices at `met` (k,) on its upper edge.

    Parameters
    ----------
    origin, along : (3,) frame of the wall.
    shape : wall without its openings in that frame, metres, y down.
    """
    pieces = target.pieces
    for part in shapely.get_parts(shapely.orient_polygons(shape)).tolist():
        if part.geom_type != "Polygon" or part.area < CUTTING.min_wall_piece_m**2:
            continue
        ring: list[tuple[float, float]] = []
        for (x, y), (next_x, next_y) in pairwise(part.exterior.coords):
            on_top = y == next_y == 0.0
            ring += [(x, y), *((joint, 0.0) for joint in met.tolist() if on_top and x < joint < next_x)]
        # keeps corners on straight edges, unlike ear clipping
        cut = shapely.get_parts(shapely.constrained_delaunay_triangles(Polygon(ring)))
        corners = shapely.get_coordinates(shapely.orient_polygons(cut, exterior_cw=True)).reshape(-1, 4, 2)[:, :3]
        flat, index = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
        low, high = flat.min(axis=0), flat.max(axis=0)
        corner = origin + low[0] * along + low[1] * _DOWN
        columns = (ChartKind.WALL, pieces.surface_count, target.building, corner, along, _DOWN, high - low)
        vertices = origin + flat[:, :1] * along + flat[:, 1:] * _DOWN
        pieces.add_charts(
            tuple(np.array([value]) for value in columns),
            (vertices, index.reshape(-1, 3), np.zeros(len(cut), np.int64), np.zeros(len(flat), np.int64)),
        )


def _distances_on_edge(start: Float64Array, along: Float64Array, length: float, points: Float64Array) -> Float64Array:
    """Return the ascending distances along an edge of the points (k, 2) on it, without its ends."""
    offset = points - start
    step = multiply_matrices(offset, along)
    off = np.abs(offset[:, 0] * along[1] - offset[:, 1] * along[0])
    return np.unique(
        np.round(
            step[(off < 2 * ROOF_SHAPES.grid_m) & (step > ROOF_SHAPES.grid_m) & (step < length - ROOF_SHAPES.grid_m)], 6
        )
    )
