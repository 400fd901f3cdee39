"""Buildings and ground into planar charts and a mesh: extruded footprints, larger surfaces cut on the world grid."""

from __future__ import annotations

from collections.abc import Sequence

import mapbox_earcut
import numpy as np
import shapely
from shapely import Polygon

from facade_core.errors import GeometryError
from facade_core.geometry.charts import GROUND, ROOF, WALL, Charts, Mesh
from facade_core.types import Building, Street

# Footprint vertices nearer than this to the wall they lie on do not split it into two facades.
COLLINEAR_M = 0.2
SHORTEST_WALL_M = 0.05
# Ground reaches this far around buildings, and fills gaps between them up to twice the second figure.
FORECOURT_M = 6.0
COURTYARD_M = 22.0


class _Pieces:
    """Collects charts and triangles while surfaces are cut."""

    def __init__(self) -> None:
        self.charts: list[tuple] = []
        self.vertices: list[np.ndarray] = []
        self.triangles: list[np.ndarray] = []
        self.surfaces = 0
        self.count = 0

    def add(self, kind: int, building: int, origin, axis_u, axis_v, polygon: Polygon) -> None:
        """One chart of the current surface; polygon is in its frame, in metres, touching x = 0 and y = 0."""
        rings = [np.asarray(ring.coords)[:-1] for ring in (polygon.exterior, *polygon.interiors)]
        flat = np.concatenate(rings)
        corners = mapbox_earcut.triangulate_float64(flat, np.cumsum([len(r) for r in rings]).astype(np.uint32))
        triangles = corners.astype(np.int64).reshape(-1, 3)
        a, b, c = (flat[triangles[:, k]] for k in range(3))
        area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
        # y runs down: counter-clockwise seen from outside is a negative area here
        triangles[area > 0] = triangles[area > 0][:, ::-1]
        size = flat.max(axis=0)
        self.charts.append((kind, self.surfaces, building, origin, axis_u, axis_v, size))
        self.vertices.append(origin + flat[:, :1] * axis_u + flat[:, 1:] * axis_v)
        self.triangles.append(triangles + self.count)
        self.count += len(flat)

    def values(self) -> tuple[Charts, Mesh]:
        columns = list(zip(*self.charts, strict=True))
        charts = Charts(
            kind=np.array(columns[0], np.uint8),
            surface=np.array(columns[1], np.int32),
            building=np.array(columns[2], np.int32),
            origin=np.array(columns[3], np.float64),
            axis_u=np.array(columns[4], np.float64),
            axis_v=np.array(columns[5], np.float64),
            size=np.array(columns[6], np.float64),
        )
        per_chart = [len(v) for v in self.vertices]
        triangle_chart = np.repeat(np.arange(len(charts)), [len(t) for t in self.triangles])
        mesh = Mesh(
            vertices=np.concatenate(self.vertices),
            triangles=np.concatenate(self.triangles).astype(np.int32),
            chart=triangle_chart.astype(np.int32),
            vertex_chart=np.repeat(np.arange(len(charts)), per_chart).astype(np.int32),
        )
        return charts, mesh


def block_surfaces(
    buildings: Sequence[Building],
    streets: Sequence[Street],
    *,
    ground_margin: float,
    largest: float,
    grid: float = 32.0,
) -> tuple[Charts, Mesh]:
    """Charts and mesh of a block: walls and flat roof of every building, and the ground near the streets at z = 0.

    Surfaces longer than `largest` metres, and all ground, are cut on the world grid of `grid` metres; pieces keep their
    surface's id. Ground reaches `ground_margin` metres from the centrelines, and fills courtyards. Raises
    GeometryError when nothing is left.
    """
    pieces = _Pieces()
    outlines = []
    for index, building in enumerate(buildings):
        footprint = shapely.orient_polygons(building.footprint.simplify(COLLINEAR_M))
        if footprint.geom_type != "Polygon" or footprint.area <= 0:
            raise GeometryError(f"building {building.id}: its footprint has no area; repair or drop it")
        outlines.append(footprint)
        for ring in (footprint.exterior, *footprint.interiors):
            _walls(pieces, index, np.asarray(ring.coords), building.height, largest, grid)
        _level(pieces, ROOF, index, footprint, building.height, largest, grid)
    if streets:
        near = [street.line.buffer(ground_margin) for street in streets]
        built = shapely.union_all(outlines)
        # closing the footprints covers courtyards and gaps that no street comes near
        around = built.buffer(COURTYARD_M).buffer(FORECOURT_M - COURTYARD_M)
        open_ground = shapely.union_all([*near, around]).difference(built)
        for part in sorted(shapely.get_parts(open_ground), key=lambda p: p.bounds):
            if part.geom_type == "Polygon" and part.area > 0.01:
                _level(pieces, GROUND, -1, part, 0.0, 0.0, grid)
    if not pieces.charts:
        raise GeometryError("the block has neither buildings nor streets; check its area and input files")
    return pieces.values()


def _walls(pieces: _Pieces, building: int, ring: np.ndarray, height: float, largest: float, grid: float) -> None:
    """One wall per edge; the ring runs with the building on its left, so an edge runs left to right seen from outside."""
    down = np.array([0.0, 0.0, -1.0])
    for a, b in zip(ring[:-1], ring[1:], strict=True):
        length = float(np.hypot(*(b - a)))
        if length < SHORTEST_WALL_M:
            continue
        along = np.append((b - a) / length, 0.0)
        cuts = _grid_cuts(a, b, length, grid) if length > largest else np.array([0.0, length])
        levels = np.arange(0.0, height, grid) if height > largest else np.array([0.0])
        levels = np.append(levels, height)
        for left, right in zip(cuts[:-1], cuts[1:], strict=True):
            for bottom, top in zip(levels[:-1], levels[1:], strict=True):
                origin = np.array([a[0], a[1], top]) + left * along
                pieces.add(WALL, building, origin, along, down, shapely.box(0, 0, right - left, top - bottom))
        pieces.surfaces += 1


def _grid_cuts(a: np.ndarray, b: np.ndarray, length: float, grid: float) -> np.ndarray:
    """Distances along a wall at which it crosses the world grid, both ends included."""
    crossings = [np.array([0.0, length])]
    for axis in range(2):
        low, high = sorted((a[axis], b[axis]))
        lines = np.arange(np.ceil(low / grid), np.floor(high / grid) + 1) * grid
        if high - low > 1e-9:
            crossings.append((lines - a[axis]) / (b[axis] - a[axis]) * length)
    cuts = np.unique(np.round(np.clip(np.concatenate(crossings), 0, length), 6))
    keep = np.concatenate([[True], np.diff(cuts) > SHORTEST_WALL_M])
    keep[-1], keep[0] = True, True
    if len(cuts) > 2 and cuts[-1] - cuts[keep][-2] <= SHORTEST_WALL_M:
        keep[np.flatnonzero(keep)[-2]] = False
    return cuts[keep]


def _level(pieces: _Pieces, kind: int, building: int, polygon: Polygon, z: float, largest: float, grid: float) -> None:
    """A horizontal surface facing up, cut on the grid when it is longer than `largest`; the chart's up is north."""
    west, south, east, north = polygon.bounds
    parts = [polygon]
    if max(east - west, north - south) > largest:
        columns = np.arange(np.floor(west / grid), np.ceil(east / grid))
        rows = np.arange(np.floor(south / grid), np.ceil(north / grid))
        shapely.prepare(polygon)
        cells = [shapely.box(c * grid, r * grid, (c + 1) * grid, (r + 1) * grid) for r in rows for c in columns]
        parts = [part for cell in cells for part in shapely.get_parts(shapely.intersection(polygon, cell))]
    for part in parts:
        if part.geom_type != "Polygon" or part.area < 1e-3:
            continue
        left, _, _, top = part.bounds
        frame = shapely.transform(
            part, lambda xy, left=left, top=top: np.column_stack([xy[:, 0] - left, top - xy[:, 1]])
        )
        origin = np.array([left, top, z])
        pieces.add(kind, building, origin, np.array([1.0, 0.0, 0.0]), np.array([0.0, -1.0, 0.0]), frame)
    pieces.surfaces += 1
