"""Level surfaces and the ground, cut on the world grid into charts."""

from __future__ import annotations

from collections.abc import Sequence

import mapbox_earcut
import numpy as np
import shapely
from shapely import Polygon

from facade_core.geometry.charts import GROUND, Pieces, frames
from facade_core.geometry.cutting import cells
from facade_core.geometry.terrain import Terrain

# Where the terrain leaves the best plane of a ground piece by more than this, all ground is cut finer, down to the last share.
GROUND_OFF_M = 0.1
FINER = (1, 2, 4)

_EAST, _SOUTH = np.array([1.0, 0.0, 0.0]), np.array([0.0, -1.0, 0.0])


def add_ground(pieces: Pieces, polygons: Sequence[Polygon], terrain: Terrain, grid: float) -> None:
    """Ground cut on the grid: level ground as it is, uneven ground draped over the terrain."""
    if terrain.level:
        for polygon in polygons:
            add_level(pieces, GROUND, -1, polygon, float(terrain.heights[0, 0]), 0.0, grid)
        return
    for share in FINER:
        draped = [[_drape(part, terrain) for part in cells(p, grid / share) if part.area >= 1e-3] for p in polygons]
        if all(off <= GROUND_OFF_M for parts in draped for *_, off in parts):
            break
    for parts in filter(None, draped):
        vertices, triangles, normal, _ = zip(*parts, strict=True)
        before = np.cumsum([0, *map(len, vertices)])
        chart = np.arange(len(parts))
        pieces.add(
            np.full(len(parts), GROUND),
            np.zeros(len(parts), np.int64),
            -1,
            *frames(np.array(normal)),
            np.concatenate(vertices),
            np.concatenate([t + start for t, start in zip(triangles, before[:-1], strict=True)]),
            np.repeat(chart, list(map(len, triangles))),
        )


def _drape(part: Polygon, terrain: Terrain) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
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
    """A horizontal surface facing up, cut on the grid when it is longer than `largest`; the chart's up is north."""
    west, south, east, north = polygon.bounds
    for part in cells(polygon, grid) if max(east - west, north - south) > largest else [polygon]:
        if part.area < 1e-3:
            continue
        left, _, _, top = part.bounds
        frame = shapely.transform(
            part, lambda xy, left=left, top=top: np.column_stack([xy[:, 0] - left, top - xy[:, 1]])
        )
        add_planar(pieces, kind, index, np.array([left, top, z]), _EAST, _SOUTH, frame)
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
