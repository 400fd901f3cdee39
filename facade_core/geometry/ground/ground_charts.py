"""Level surfaces and the ground, cut on the world grid into charts."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import mapbox_earcut
import numpy as np
import shapely
from shapely import Polygon

from facade_core.geometry.charts import ChartKind, Pieces, frames
from facade_core.geometry.cutting import cells
from facade_core.geometry.ground.terrain import Terrain

# Where the terrain leaves the best plane of a ground piece by more than this, the piece is cut finer, down to the last share.
GROUND_OFF_M = 0.1
FINER = (1, 2, 4)

_EAST, _SOUTH = np.array([1.0, 0.0, 0.0]), np.array([0.0, -1.0, 0.0])


def add_ground(pieces: Pieces, polygons: Sequence[Polygon], terrain: Terrain, grid: float) -> None:
    """Ground cut on the grid: level ground as it is, uneven ground draped over the terrain."""
    if terrain.level:
        for polygon in polygons:
            add_level(pieces, ChartKind.GROUND, -1, polygon, float(terrain.heights[0, 0]), 0.0, grid)
        return
    cut = [_fine(polygon, terrain, grid) for polygon in polygons]
    lines = _lines([part for pieces_of in cut for part, _ in pieces_of])
    draped = [[_meeting(part, on_terrain, lines, terrain) for part, on_terrain in pieces_of] for pieces_of in cut]
    for parts in filter(None, draped):
        vertices, triangles, normal, _ = zip(*parts, strict=True)
        before = np.cumsum([0, *map(len, vertices)])
        chart = np.arange(len(parts))
        pieces.add(
            np.full(len(parts), ChartKind.GROUND),
            np.zeros(len(parts), np.int64),
            -1,
            *frames(np.array(normal)),
            np.concatenate(vertices),
            np.concatenate([t + start for t, start in zip(triangles, before[:-1], strict=True)]),
            np.repeat(chart, list(map(len, triangles))),
        )


# A piece of ground on the terrain: see _drape.
_Draped = tuple[np.ndarray, np.ndarray, np.ndarray, float]
# For x and for y: along each line on which corners lie, where they do.
_Lines = tuple[dict[float, np.ndarray], dict[float, np.ndarray]]


def _fine(
    polygon: Polygon, terrain: Terrain, grid: float, shares: Sequence[int] = FINER
) -> list[tuple[Polygon, _Draped]]:
    """Ground cut on the grid, each piece as fine as the terrain under it needs."""
    parts = []
    for part in cells(polygon, grid / shares[0]):
        if part.area < 1e-3:
            continue
        draped = _drape(part, terrain)
        if len(shares) > 1 and draped[-1] > GROUND_OFF_M:
            parts += _fine(part, terrain, grid, shares[1:])
        else:
            parts.append((part, draped))
    return parts


def _lines(parts: Sequence[Polygon]) -> _Lines:
    points = np.unique(shapely.get_coordinates(parts), axis=0)
    lines: _Lines = ({}, {})
    for axis, found in enumerate(lines):
        order = np.lexsort((points[:, 1 - axis], points[:, axis]))
        at, first = np.unique(points[order, axis], return_index=True)
        found.update(zip(at.tolist(), np.split(points[order, 1 - axis], first[1:]), strict=True))
    return lines


def _meeting(part: Polygon, draped: _Draped, lines: _Lines, terrain: Terrain) -> _Draped:
    """A piece with the corners of those beside it on its borders: one that is cut coarser has the same heights along them."""

    def met(ring: np.ndarray) -> np.ndarray:
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
    rings = [met(ring) for ring in before]
    if all(len(ring) == len(own) for ring, own in zip(rings, before, strict=True)):
        return draped
    return _drape(Polygon(rings[0], rings[1:]), terrain)


def _drape(part: Polygon, terrain: Terrain) -> _Draped:
    """A piece of ground on the terrain: vertices (v, 3), triangles (t, 3), its best plane's normal, and how far the terrain
    leaves that plane, metres."""
    cut = shapely.get_parts(shapely.constrained_delaunay_triangles(part))
    corners = shapely.get_coordinates(shapely.orient_polygons(cut)).reshape(-1, 4, 2)[:, :3].reshape(-1, 2)
    points, index = np.unique(corners, axis=0, return_inverse=True)
    west, south, east, north = part.bounds
    x, y = np.meshgrid(np.linspace(west, east, 9), np.linspace(south, north, 9))
    samples = np.column_stack([x.ravel(), y.ravel()])
    samples = np.concatenate([points, samples[shapely.contains_xy(part, samples)]])
    heights = terrain.height(samples)
    system = np.column_stack([samples - points[0], np.ones(len(samples))])
    plane = np.linalg.lstsq(system, heights, rcond=None)[0]
    off = float(np.abs(system @ plane - heights).max())
    normal = np.array([-plane[0], -plane[1], 1.0])
    vertices = np.column_stack([points, heights[: len(points)]])
    return vertices, index.reshape(-1, 3), normal / np.linalg.norm(normal), off


def add_level(pieces: Pieces, kind: int, index: int, polygon: Polygon, z: float, largest: float, grid: float) -> None:
    """A horizontal surface, facing up but for a ceiling, cut on the grid when it is longer than `max_chart_side`; the chart's up is
    north, of a ceiling south."""
    down = kind == ChartKind.CEILING
    west, south, east, north = polygon.bounds
    for part in cells(polygon, grid) if max(east - west, north - south) > largest else [polygon]:
        if part.area < 1e-3:
            continue
        left, bottom, _, top = part.bounds
        first, way = (bottom, 1.0) if down else (top, -1.0)
        frame = shapely.transform(
            part,
            lambda xy, left=left, first=first, way=way: np.column_stack([xy[:, 0] - left, way * (xy[:, 1] - first)]),
        )
        add_planar(pieces, kind, index, np.array([left, first, z]), _EAST, -way * _SOUTH, frame)
    pieces.surfaces += 1


def add_planar(
    pieces: Pieces, kind: int, index: int, origin: np.ndarray, axis_u: np.ndarray, axis_v: np.ndarray, polygon: Polygon
) -> None:
    """One chart of the current surface; polygon is in its frame, in metres, touching x = 0 and y = 0."""
    rings = [np.asarray(ring.coords)[:-1] for ring in (polygon.exterior, *polygon.interiors)]
    flat = np.concatenate(rings)
    corners = mapbox_earcut.triangulate_float64(flat, np.cumsum([len(r) for r in rings]).astype(np.uint32))
    triangles = corners.astype(np.int64).reshape(-1, 3)
    a, b, c = (flat[triangles[:, k]] for k in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    # y runs down: counter-clockwise seen from outside is a negative area here
    triangles[area > 0] = triangles[area > 0][:, ::-1]
    one = [np.array([value]) for value in (kind, pieces.surfaces, index, origin, axis_u, axis_v, flat.max(axis=0))]
    vertices = origin + flat[:, :1] * axis_u + flat[:, 1:] * axis_v
    zeros = np.zeros(len(triangles), np.int64)
    pieces.add_charts(tuple(one), (vertices, triangles, zeros, np.zeros(len(flat), np.int64)))
