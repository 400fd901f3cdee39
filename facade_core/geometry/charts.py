"""Charts: planar pieces of surface with an affine frame, and the mesh they make up."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property

import numpy as np
import shapely

from facade_core.core.grouping import RowIndex

KINDS = ("wall", "roof", "ground", "window", "door", "ceiling", "metal")


class ChartKind(IntEnum):
    """Kind of a chart: the index of its name in `KINDS`."""

    WALL = 0
    ROOF = 1
    GROUND = 2
    WINDOW = 3
    DOOR = 4
    CEILING = 5
    METAL = 6


# A surface that leans less than this from the horizontal (sine) has its chart's right to the east, as a flat one.
LEVEL = 0.035
# The corners of a chart as shares of its width and height.
CORNERS = np.array([[0, 0], [0, 1], [1, 0], [1, 1]])


@dataclass(frozen=True)
class Charts:
    """Planar charts as columns; row i is chart i.

    kind (n,) uint8: an index into KINDS, "ground" is the terrain, "ceiling" what faces down,
    "metal" gutters, pipes and vents;
    surface (n,) int32: the uncut surface the chart is a piece of;
    building (n,) int32: -1 for ground;
    origin, axis_u, axis_v (n, 3) float64: the frame, see `points`;
    size (n, 2) float64: width and height in metres.
    """

    kind: np.ndarray
    surface: np.ndarray
    building: np.ndarray
    origin: np.ndarray
    axis_u: np.ndarray
    axis_v: np.ndarray
    size: np.ndarray

    def __len__(self) -> int:
        return len(self.kind)

    def normal(self) -> np.ndarray:
        """Outward unit normals, (n, 3), not to be written to: y runs down, so v x u points at whoever looks at the chart."""
        return self._normal

    @cached_property
    def _normal(self) -> np.ndarray:
        normal = np.cross(self.axis_v, self.axis_u)
        normal.flags.writeable = False
        return normal

    def points(self, chart: int | np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """World points (..., 3) = origin + x axis_u + y axis_v of places in charts' frames, in metres; chart, x and y are
        broadcast against each other to (...)."""
        return self.origin[chart] + x[..., None] * self.axis_u[chart] + y[..., None] * self.axis_v[chart]

    def at_shares(self, charts: np.ndarray, share: np.ndarray) -> np.ndarray:
        """World points (k, s, 3) at shares (s, 2) of the width and height of charts (k,)."""
        x, y = np.moveaxis(share * self.size[charts][:, None], -1, 0)
        return self.points(charts[:, None], x, y)

    def coordinates(self, chart: np.ndarray, points: np.ndarray) -> np.ndarray:
        """World points (k, 3) in the frames of their charts (k,): (k, 2) metres, x right and y down."""
        offset = points - self.origin[chart]
        return np.stack([np.einsum("ij,ij->i", offset, axis[chart]) for axis in (self.axis_u, self.axis_v)], axis=1)

    def near(self, chart: int, reach: float) -> np.ndarray:
        """The charts (k,) whose boxes, seen from above, come within `reach` metres of a chart's, it among them; ascending."""
        low, high = self._low[chart] - reach, self._high[chart] + reach
        return np.sort(self._boxes.query(shapely.box(*low, *high)))

    @cached_property
    def longest(self) -> float:
        """The longest diagonal of a chart, metres."""
        return float(np.hypot(*self.size.T).max(initial=0.0))

    @cached_property
    def _low(self) -> np.ndarray:
        return self.at_shares(np.arange(len(self)), CORNERS)[..., :2].min(axis=1)

    @cached_property
    def _high(self) -> np.ndarray:
        return self.at_shares(np.arange(len(self)), CORNERS)[..., :2].max(axis=1)

    @cached_property
    def boxes(self) -> np.ndarray:
        """The charts as boxes seen from above, (n,) polygons."""
        return shapely.box(*self._low.T, *self._high.T)

    @cached_property
    def _boxes(self) -> shapely.STRtree:
        return shapely.STRtree(self.boxes)

    def texels(self, texels_per_metre: float | np.ndarray) -> np.ndarray:
        """Raster sizes (n, 2) int64, width and height, of all at one density or of each at its own (n,)."""
        return raster_sizes(self.size, texels_per_metre)


@dataclass(frozen=True)
class Mesh:
    """Triangles of all charts.

    vertices (v, 3) float64: where the source has them, which may be centimetres off their chart's plane;
    triangles (t, 3) int32;
    chart (t,) int32;
    vertex_chart (v,) int32: vertices are not shared between charts, so each has one place in its chart;
    texture (t,) int32: the source's own picture, -1 without;
    uv (t, 3, 2) float32: its coordinates at the corners, u right and v up.

    texture and uv may be left out: no pictures.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    chart: np.ndarray
    vertex_chart: np.ndarray
    texture: np.ndarray = None  # type: ignore[assignment]
    uv: np.ndarray = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.texture is None:
            object.__setattr__(self, "texture", np.full(len(self.triangles), -1, np.int32))
        if self.uv is None:
            object.__setattr__(self, "uv", np.zeros((len(self.triangles), 3, 2), np.float32))

    def triangles_of(self, chart: int) -> np.ndarray:
        """The triangles (k,) of a chart, ascending."""
        return self._by_chart.rows_with(chart)

    @cached_property
    def _by_chart(self) -> RowIndex:
        return RowIndex(self.chart)

    def chart_coordinates(self, charts: Charts) -> np.ndarray:
        """Each vertex in its chart's frame: (v, 2) metres, x right and y down."""
        return charts.coordinates(self.vertex_chart, self.vertices)


def raster_sizes(size: np.ndarray, texels_per_metre: float | np.ndarray) -> np.ndarray:
    """Widths and heights (n, 2) int64 in texels of sizes (n, 2) in metres: the last texel may reach past the edge."""
    return np.maximum(1, np.ceil((size.T * texels_per_metre).T - 1e-6)).astype(np.int64)


def frames(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Axes u and v (n, 3) of charts with unit normals (n, 3): u level (east on level charts), v = u x n, down on walls."""
    level = np.hypot(normal[:, 0], normal[:, 1]) < LEVEL
    east = np.array([1.0, 0.0, 0.0]) - normal[:, :1] * normal
    along = np.stack([-normal[:, 1], normal[:, 0], np.zeros(len(normal))], axis=1)
    axis_u = np.where(level[:, None], east, along)
    axis_u /= np.linalg.norm(axis_u, axis=1, keepdims=True)
    return axis_u, np.cross(axis_u, normal)


class Pieces:
    """Collects charts and triangles while surfaces are cut."""

    def __init__(self) -> None:
        self._charts: list[tuple[np.ndarray, ...]] = []
        self._mesh: list[tuple[np.ndarray, ...]] = []
        self._count = 0
        self._vertices = 0
        self.surfaces = 0

    def __len__(self) -> int:
        return self._count

    def add(
        self,
        kind: np.ndarray,
        surface: np.ndarray,
        building: int,
        axis_u: np.ndarray,
        axis_v: np.ndarray,
        vertices: np.ndarray,
        triangles: np.ndarray,
        chart: np.ndarray,
        texture: np.ndarray | None = None,
        uv: np.ndarray | None = None,
    ) -> None:
        """Charts of one building (-1: ground), with their triangles.

        kind, surface (n,), surfaces counted from those before; axis_u, axis_v (n, 3); vertices (v, 3), triangles (t, 3), chart
        (t,) as in Mesh, every chart with a triangle, a vertex free to be shared between charts. The origin is put where the
        chart's triangles touch x = 0 and y = 0, on their mean plane.
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
        # measured from the first point: a flat chart's plane is then exactly where its vertices are
        off = off[first] + np.add.reduceat(off - off[first][own], first) / np.diff(np.append(first, len(own)))
        origin = low[:, :1] * axis_u + low[:, 1:] * axis_v + off[:, None] * normal
        self.add_charts(
            (kind, surface + self.surfaces, np.full(len(kind), building), origin, axis_u, axis_v, high - low),
            (points, corner.reshape(-1, 3), chart, own),
            texture,
            uv,
        )
        self.surfaces += int(surface.max()) + 1

    def add_charts(
        self,
        charts: tuple[np.ndarray, ...],
        mesh: tuple[np.ndarray, ...],
        texture: np.ndarray | None = None,
        uv: np.ndarray | None = None,
    ) -> None:
        """Columns of Charts, and of their Mesh with indices from 0, behind what is there; surface is taken as it is."""
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

    def values(self) -> tuple[Charts, Mesh]:
        """All charts and their mesh, in the order they were added."""
        kind, surface, building, *frame = (np.concatenate(column) for column in zip(*self._charts, strict=True))
        charts = Charts(kind.astype(np.uint8), surface.astype(np.int32), building.astype(np.int32), *frame)
        vertices, triangles, chart, own, texture, uv = (np.concatenate(c) for c in zip(*self._mesh, strict=True))
        triangles, chart, own, texture = (column.astype(np.int32) for column in (triangles, chart, own, texture))
        return charts, Mesh(vertices, triangles, chart, own, texture, uv)
