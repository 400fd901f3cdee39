"""Charts, which are planar pieces of surface with an affine frame, and the mesh that they form."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property

import numpy as np
import shapely

from facade_core.core.arrays import (
    AnyArray,
    Float32Array,
    Float64Array,
    FloatArray,
    Int32Array,
    Int64Array,
    IntArray,
    NumericArray,
    ObjectArray,
    UInt8Array,
)
from facade_core.core.grouping import RowsByValue
from facade_core.geometry.settings import CHARTS

CHART_KINDS = ("wall", "roof", "ground", "window", "door", "ceiling", "metal")


class ChartKind(IntEnum):
    """Kind of a chart: the index of its name in `KINDS`."""

    WALL = 0
    ROOF = 1
    GROUND = 2
    WINDOW = 3
    DOOR = 4
    CEILING = 5
    METAL = 6


# Corners of a chart as shares of its width and height.
CORNER_SHARES = np.array([[0, 0], [0, 1], [1, 0], [1, 1]])


@dataclass(frozen=True)
class Charts:
    """Planar charts as columns; row i is chart i.

    Attributes
    ----------
    kind : (n,) `ChartKind`; ground is the terrain, a ceiling faces down, metal is gutters, pipes and vents.
    surface : (n,) id of the uncut surface; its pieces share it.
    building : (n,) row of the building, -1 for ground.
    origin, axis_u, axis_v : (n, 3) frame, see `points`.
    size : (n, 2) width and height in metres.
    """

    kind: UInt8Array
    surface: Int32Array
    building: Int32Array
    origin: Float64Array
    axis_u: Float64Array
    axis_v: Float64Array
    size: Float64Array

    def __len__(self) -> int:
        return len(self.kind)

    def normals(self) -> Float64Array:
        """Return the outward unit normals (n, 3), read-only: v x u, as y runs down."""
        return self._normal

    @cached_property
    def _normal(self) -> Float64Array:
        normal = np.cross(self.axis_v, self.axis_u)
        normal.flags.writeable = False
        return normal

    def points(self, chart: int | IntArray, x: FloatArray, y: FloatArray) -> Float64Array:
        """Return world points = origin + x axis_u + y axis_v of places in chart frames.

        Parameters
        ----------
        chart : index, or (...) indices.
        x, y : (...) metres, broadcast against `chart`.

        Returns
        -------
        (..., 3) metres.
        """
        points = self.origin[chart] + x[..., None] * self.axis_u[chart] + y[..., None] * self.axis_v[chart]
        return np.asarray(points, np.float64)

    def points_at_shares(self, charts: IntArray, share: NumericArray) -> Float64Array:
        """Return world points (k, s, 3) at shares (s, 2) of the width and height of charts (k,)."""
        x, y = np.moveaxis(share * self.size[charts][:, None], -1, 0)
        return self.points(charts[:, None], x, y)

    def coordinates(self, chart: IntArray, points: Float64Array) -> Float64Array:
        """Return the chart coordinates of world points.

        Parameters
        ----------
        chart : (k,) chart of each point.
        points : (k, 3) world points in metres.

        Returns
        -------
        (k, 2) metres, x right and y down.
        """
        offset = points - self.origin[chart]
        return np.stack([np.einsum("ij,ij->i", offset, axis[chart]) for axis in (self.axis_u, self.axis_v)], axis=1)

    def charts_within(self, chart: int, reach: float) -> Int64Array:
        """Return the charts (k,), ascending, whose boxes from above are within `reach` metres of a chart's, itself included."""
        low, high = self._low[chart] - reach, self._high[chart] + reach
        return np.sort(self._boxes.query(shapely.box(*low, *high)))

    def pairs_within(self, charts: Int64Array, reach: float) -> tuple[Int64Array, Int64Array]:
        """Return `charts_within` of many charts (k,) as pairs: row in `charts`, ascending, and chart near it."""
        low, high = self._low[charts] - reach, self._high[charts] + reach
        pairs = self._boxes.query(shapely.box(*low.T, *high.T))
        row, near = pairs[:, np.lexsort(pairs[::-1])]
        return row, near

    @cached_property
    def max_diagonal(self) -> float:
        """Return the longest diagonal of a chart in metres."""
        return float(np.hypot(*self.size.T).max(initial=0.0))

    @cached_property
    def _low(self) -> Float64Array:
        low: Float64Array = self.points_at_shares(np.arange(len(self)), CORNER_SHARES)[..., :2].min(axis=1)
        return low

    @cached_property
    def _high(self) -> Float64Array:
        high: Float64Array = self.points_at_shares(np.arange(len(self)), CORNER_SHARES)[..., :2].max(axis=1)
        return high

    @cached_property
    def boxes(self) -> ObjectArray:
        """Return the bounding boxes of the charts seen from above, (n,) polygons."""
        boxes: ObjectArray = shapely.box(*self._low.T, *self._high.T)
        return boxes

    @cached_property
    def _boxes(self) -> shapely.STRtree:
        return shapely.STRtree(self.boxes)

    def texels(self, texels_per_metre: float | Float64Array) -> Int64Array:
        """Return the sizes (n, 2) of all charts in texels, at one density or a density (n,) each."""
        return raster_sizes(self.size, texels_per_metre)


@dataclass(frozen=True)
class Mesh:
    """Triangles of all charts.

    Attributes
    ----------
    vertices : (v, 3) as in the source, up to centimetres off their chart's plane.
    triangles : (t, 3) vertex indices.
    chart : (t,) chart of each triangle.
    vertex_chart : (v,) chart of each vertex; charts share no vertices.
    texture : (t,) index of the source's picture, -1 without; may be left out.
    uv : (t, 3, 2) texture coordinates of the corners, u right and v up; may be left out.
    """

    vertices: Float64Array
    triangles: Int32Array
    chart: Int32Array
    vertex_chart: Int32Array
    texture: Int32Array = None  # type: ignore[assignment]
    uv: Float32Array = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.texture is None:
            object.__setattr__(self, "texture", np.full(len(self.triangles), -1, np.int32))
        if self.uv is None:
            object.__setattr__(self, "uv", np.zeros((len(self.triangles), 3, 2), np.float32))

    def chart_triangles(self, chart: int) -> Int64Array:
        """Return the triangles (k,) of a chart, ascending."""
        return self._by_chart.rows_with(chart)

    @cached_property
    def _by_chart(self) -> RowsByValue:
        return RowsByValue(self.chart)

    def chart_coordinates(self, charts: Charts) -> Float64Array:
        """Return each vertex in the frame of its chart: (v, 2) metres, x right and y down."""
        return charts.coordinates(self.vertex_chart, self.vertices)


def raster_sizes(size: Float64Array, texels_per_metre: float | Float64Array) -> Int64Array:
    """Convert sizes in metres to texels, rounded up.

    Parameters
    ----------
    size : (n, 2) width and height in metres.
    texels_per_metre : one density, or (n,).

    Returns
    -------
    (n, 2) texels, at least 1.
    """
    return np.maximum(1, np.ceil((size.T * texels_per_metre).T - 1e-6)).astype(np.int64)


def chart_axes_right_down(normal: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Compute the axes of charts: u horizontal (east on level charts), v = u x n, which runs down on walls.

    Parameters
    ----------
    normal : (n, 3) unit normals.

    Returns
    -------
    axis_u and axis_v, (n, 3) each.
    """
    level = np.hypot(normal[:, 0], normal[:, 1]) < CHARTS.max_level_sine
    east = np.array([1.0, 0.0, 0.0]) - normal[:, :1] * normal
    along = np.stack([-normal[:, 1], normal[:, 0], np.zeros(len(normal))], axis=1)
    axis_u = np.where(level[:, None], east, along)
    axis_u /= np.linalg.norm(axis_u, axis=1, keepdims=True)
    return axis_u, np.cross(axis_u, normal)


@dataclass(frozen=True)
class SurfaceTarget:
    """Place where the surfaces of one building are added, and how long ones are cut.

    Attributes
    ----------
    pieces : charts collected so far; extended in place.
    building : row of the building, -1 for ground.
    largest : metres; longer surfaces are cut.
    grid : step of the world grid in metres.
    """

    pieces: ChartBuilder
    building: int
    largest: float
    grid: float


class ChartBuilder:
    """Collector of charts and triangles while surfaces are cut."""

    def __init__(self) -> None:
        self._charts: list[tuple[AnyArray, ...]] = []
        self._mesh: list[tuple[AnyArray, ...]] = []
        self._count = 0
        self._vertices = 0
        self.surface_count = 0

    def __len__(self) -> int:
        return self._count

    def add_surfaces(
        self,
        kind: UInt8Array,
        surface: Int64Array,
        building: int,
        axis_u: Float64Array,
        axis_v: Float64Array,
        vertices: Float64Array,
        triangles: Int64Array,
        chart: Int64Array,
        texture: Int32Array | None = None,
        uv: Float32Array | None = None,
    ) -> None:
        """Add charts of one building with their triangles.

        The origin of a chart is where its triangles touch x = 0 and y = 0, on their mean plane.

        Parameters
        ----------
        kind : (n,) `ChartKind`.
        surface : (n,) surface of each chart, counted from the surfaces added before.
        building : row of the building, -1 for ground.
        axis_u, axis_v : (n, 3) frame axes.
        vertices : (v, 3) metres; charts may share them.
        triangles : (t, 3) vertex indices.
        chart : (t,) chart of each triangle; every chart has one.
        texture, uv : as in `Mesh`.
        """
        pair, corner = np.unique(chart[:, None] * len(vertices) + triangles, return_inverse=True)
        own, vertex = np.divmod(pair, len(vertices))
        points = vertices[vertex]
        first = np.searchsorted(own, np.arange(len(kind)))
        x = np.einsum("ij,ij->i", points, axis_u[own])
        y = np.einsum("ij,ij->i", points, axis_v[own])
        low = np.stack([np.minimum.reduceat(c, first) for c in (x, y)], axis=1)
        high = np.stack([np.maximum.reduceat(c, first) for c in (x, y)], axis=1)
        normal = np.cross(axis_v, axis_u)
        off = np.einsum("ij,ij->i", points, normal[own])
        # relative to the first point, so that the plane of a flat chart contains its vertices exactly
        off = off[first] + np.add.reduceat(off - off[first][own], first) / np.diff(np.append(first, len(own)))
        origin = low[:, :1] * axis_u + low[:, 1:] * axis_v + off[:, None] * normal
        self.add_charts(
            (kind, surface + self.surface_count, np.full(len(kind), building), origin, axis_u, axis_v, high - low),
            (points, corner.reshape(-1, 3), chart, own),
            texture,
            uv,
        )
        self.surface_count += int(surface.max()) + 1

    def add_charts(
        self,
        charts: tuple[NumericArray, ...],
        mesh: tuple[NumericArray, ...],
        texture: Int32Array | None = None,
        uv: Float32Array | None = None,
    ) -> None:
        """Append columns of `Charts` and of their `Mesh`.

        Parameters
        ----------
        charts : columns in the order of `Charts`; surface ids are absolute.
        mesh : vertices, triangles, chart and vertex_chart, counted from 0.
        texture, uv : as in `Mesh`.
        """
        vertices, triangles, chart, vertex_chart = mesh
        self._charts.append(charts)
        self._mesh.append(
            (
                vertices,
                triangles + self._vertices,
                chart + self._count,
                vertex_chart + self._count,
                np.full(len(triangles), -1, np.int32) if texture is None else texture,
                np.zeros((len(triangles), 3, 2), np.float32) if uv is None else uv,
            )
        )
        self._count += len(charts[0])
        self._vertices += len(vertices)

    def build(self) -> tuple[Charts, Mesh]:
        """Return all charts and their mesh, in the order in which they were added."""
        kind, surface, building, *frame = (np.concatenate(column) for column in zip(*self._charts, strict=True))
        charts = Charts(kind.astype(np.uint8), surface.astype(np.int32), building.astype(np.int32), *frame)
        vertices, triangles, chart, own, texture, uv = (np.concatenate(c) for c in zip(*self._mesh, strict=True))
        triangles, chart, own, texture = (column.astype(np.int32) for column in (triangles, chart, own, texture))
        return charts, Mesh(vertices, triangles, chart, own, texture, uv)
