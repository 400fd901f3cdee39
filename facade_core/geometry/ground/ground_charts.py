"""Charts of level surfaces and of the ground, cut on the world grid."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import mapbox_earcut
import numpy as np
import shapely
from shapely import Polygon

from facade_core.core.arrays import Float64Array, Int64Array
from facade_core.core.fixed_order import multiply_matrices, solve_least_squares, vector_length
from facade_core.geometry.charts import ChartBuilder, ChartKind, SurfaceTarget, chart_axes_right_down
from facade_core.geometry.cutting import cut_polygon_on_grid
from facade_core.geometry.ground.settings import GROUND_CHARTS
from facade_core.geometry.ground.terrain import Terrain

_EAST, _SOUTH = np.array([1.0, 0.0, 0.0]), np.array([0.0, -1.0, 0.0])


def add_ground_charts(pieces: ChartBuilder, polygons: Sequence[Polygon], terrain: Terrain, grid: float) -> None:
    """Add ground as charts: level ground flat, uneven ground draped over the terrain.

    Parameters
    ----------
    pieces : charts collected so far; extended in place.
    polygons : areas of ground.
    terrain : ground heights.
    grid : step of the world grid in metres.
    """
    if terrain.is_level:
        target = SurfaceTarget(pieces, -1, 0.0, grid)
        for polygon in polygons:
            add_horizontal_surface(target, ChartKind.GROUND, polygon, float(terrain.heights[0, 0]))
        return
    cut = [_cut_fine(polygon, terrain, grid) for polygon in polygons]
    lines = _corner_lines([part for pieces_of in cut for part, _ in pieces_of])
    draped = [[_match_corners(part, on_terrain, lines, terrain) for part, on_terrain in pieces_of] for pieces_of in cut]
    for parts in filter(None, draped):
        vertices, triangles, normal, _ = zip(*parts, strict=True)
        before = np.cumsum([0, *map(len, vertices)])
        chart = np.arange(len(parts))
        pieces.add_surfaces(
            np.full(len(parts), ChartKind.GROUND),
            np.zeros(len(parts), np.int64),
            -1,
            *chart_axes_right_down(np.array(normal)),
            np.concatenate(vertices),
            np.concatenate([t + start for t, start in zip(triangles, before[:-1], strict=True)]),
            np.repeat(chart, list(map(len, triangles))),
        )


# Vertices, triangles, normal and greatest distance from the plane: see _drape_piece.
_DrapedPiece = tuple[Float64Array, Int64Array, Float64Array, float]
# For x and for y: coordinate of a line -> sorted positions of the corners on it.
_CornerLines = tuple[dict[float, Float64Array], dict[float, Float64Array]]


def _cut_fine(
    polygon: Polygon, terrain: Terrain, grid: float, shares: Sequence[int] = GROUND_CHARTS.grid_divisors
) -> list[tuple[Polygon, _DrapedPiece]]:
    """Cut ground on the grid, as fine as the terrain below each piece needs."""
    parts = []
    for part in cut_polygon_on_grid(polygon, grid / shares[0]):
        if part.area < 1e-3:
            continue
        draped = _drape_piece(part, terrain)
        if len(shares) > 1 and draped[-1] > GROUND_CHARTS.max_off_plane_m:
            parts += _cut_fine(part, terrain, grid, shares[1:])
        else:
            parts.append((part, draped))
    return parts


def _corner_lines(parts: Sequence[Polygon]) -> _CornerLines:
    points = np.unique(shapely.get_coordinates(parts), axis=0)
    lines: _CornerLines = ({}, {})
    for axis, found in enumerate(lines):
        order = np.lexsort((points[:, 1 - axis], points[:, axis]))
        at, first = np.unique(points[order, axis], return_index=True)
        found.update(zip(at.tolist(), np.split(points[order, 1 - axis], first)[1:], strict=True))
    return lines


def _match_corners(part: Polygon, draped: _DrapedPiece, lines: _CornerLines, terrain: Terrain) -> _DrapedPiece:
    """Insert the corners of adjacent pieces on a piece's borders, so that coarse and fine pieces meet without gaps."""

    def insert_corners(ring: Float64Array) -> Float64Array:
        points = []
        for start, end in pairwise(ring.tolist()):
            points.append(start)
            for axis in range(2):
                if start[axis] == end[axis]:
                    along, (low, high) = lines[axis][start[axis]], sorted((start[1 - axis], end[1 - axis]))
                    between = along[(along > low) & (along < high)][:: 1 if start[1 - axis] == low else -1]
                    points += [[start[0], other] if axis == 0 else [other, start[1]] for other in between.tolist()]
        return np.array([*points, points[0]])

    before = [shapely.get_coordinates(ring) for ring in (part.exterior, *part.interiors)]
    rings = [insert_corners(ring) for ring in before]
    if all(len(ring) == len(own) for ring, own in zip(rings, before, strict=True)):
        return draped
    return _drape_piece(Polygon(rings[0], rings[1:]), terrain)


def _drape_piece(part: Polygon, terrain: Terrain) -> _DrapedPiece:
    """Drape a piece over the terrain: vertices (v, 3), triangles (t, 3), normal of the best plane, distance to it."""
    cut = shapely.get_parts(shapely.constrained_delaunay_triangles(part))
    corners = shapely.get_coordinates(shapely.orient_polygons(cut)).reshape(-1, 4, 2)[:, :3].reshape(-1, 2)
    points, index = np.unique(corners, axis=0, return_inverse=True)
    west, south, east, north = part.bounds
    x, y = np.meshgrid(np.linspace(west, east, 9), np.linspace(south, north, 9))
    samples = np.column_stack([x.ravel(), y.ravel()])
    samples = np.concatenate([points, samples[shapely.contains_xy(part, samples)]])
    heights = terrain.interpolate(samples)
    system = np.column_stack([samples - points[0], np.ones(len(samples))])
    plane = solve_least_squares(system, heights[:, None])[:, 0]
    off = float(np.abs(multiply_matrices(system, plane) - heights).max())
    normal = np.array([-plane[0], -plane[1], 1.0])
    vertices = np.column_stack([points, heights[: len(points)]])
    return vertices, index.reshape(-1, 3), normal / vector_length(normal), off


def add_horizontal_surface(target: SurfaceTarget, kind: int, polygon: Polygon, z: float) -> None:
    """Add a horizontal surface, cut on the grid where it is too long.

    It faces up, with north up in its chart; a ceiling faces down, with south up.

    Parameters
    ----------
    target : place of the surface.
    kind : `ChartKind`.
    z : height in metres.
    """
    down = kind == ChartKind.CEILING
    west, south, east, north = polygon.bounds
    is_long = max(east - west, north - south) > target.largest
    for part in cut_polygon_on_grid(polygon, target.grid) if is_long else [polygon]:
        if part.area < 1e-3:
            continue
        left, bottom, _, top = part.bounds
        first, way = (bottom, 1.0) if down else (top, -1.0)
        frame = shapely.transform(
            part,
            lambda xy, left=left, first=first, way=way: np.column_stack([xy[:, 0] - left, way * (xy[:, 1] - first)]),
        )
        add_planar_chart(target, kind, (np.array([left, first, z]), _EAST, -way * _SOUTH), frame)
    target.pieces.surface_count += 1


def add_planar_chart(
    target: SurfaceTarget, kind: int, frame: tuple[Float64Array, Float64Array, Float64Array], polygon: Polygon
) -> None:
    """Add one chart of the current surface.

    Parameters
    ----------
    target : place of the chart.
    kind : `ChartKind`.
    frame : (3,) origin, axis_u and axis_v.
    polygon : outline in the frame in metres, touching x = 0 and y = 0.
    """
    rings = [np.asarray(ring.coords)[:-1] for ring in (polygon.exterior, *polygon.interiors)]
    flat = np.concatenate(rings)
    corners = mapbox_earcut.triangulate_float64(flat, np.cumsum([len(r) for r in rings]).astype(np.uint32))
    triangles = corners.astype(np.int64).reshape(-1, 3)
    a, b, c = (flat[triangles[:, k]] for k in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    # y runs down: counter-clockwise seen from outside is a negative area here
    triangles[area > 0] = triangles[area > 0][:, ::-1]
    pieces, (origin, axis_u, axis_v) = target.pieces, frame
    columns = (kind, pieces.surface_count, target.building, origin, axis_u, axis_v, flat.max(axis=0))
    one = [np.array([value]) for value in columns]
    vertices = origin + flat[:, :1] * axis_u + flat[:, 1:] * axis_v
    zeros = np.zeros(len(triangles), np.int64)
    pieces.add_charts(tuple(one), (vertices, triangles, zeros, np.zeros(len(flat), np.int64)))
