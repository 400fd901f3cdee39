"""Charts: planar pieces of surface with an affine frame, and the mesh they make up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

KINDS = ("wall", "roof", "ground")
WALL, ROOF, GROUND = range(3)


@dataclass(frozen=True)
class Charts:
    """Planar charts as columns; row i is chart i.

    kind (n,) uint8, an index into KINDS; surface (n,) int32, the uncut surface the chart is a piece of; building (n,) int32,
    -1 for ground; origin, axis_u, axis_v (n, 3) float64: point(x, y) = origin + x axis_u + y axis_v; size (n, 2) float64,
    width and height in metres.
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
        """Outward unit normals, (n, 3): y runs down, so v x u points at whoever looks at the chart."""
        return np.cross(self.axis_v, self.axis_u)

    def texels(self, texels_per_metre: float) -> np.ndarray:
        """Raster sizes (n, 2) int64, width and height: the last texel may reach past the edge."""
        return np.maximum(1, np.ceil(self.size * texels_per_metre - 1e-6)).astype(np.int64)


@dataclass(frozen=True)
class Mesh:
    """Triangles of all charts: vertices (v, 3) float64, triangles (t, 3) int32, chart (t,) int32.

    Vertices are not shared between charts, so a vertex has one texture coordinate; vertex_chart (v,) int32.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    chart: np.ndarray
    vertex_chart: np.ndarray

    def chart_coordinates(self, charts: Charts) -> np.ndarray:
        """Each vertex in its chart's frame: (v, 2) metres, x right and y down."""
        offset = self.vertices - charts.origin[self.vertex_chart]
        x = np.einsum("ij,ij->i", offset, charts.axis_u[self.vertex_chart])
        y = np.einsum("ij,ij->i", offset, charts.axis_v[self.vertex_chart])
        return np.stack([x, y], axis=1)
