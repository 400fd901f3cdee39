"""Plane of a wall as a coordinate system: metres along and up, and its pose in the world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facade_core.core.arrays import Float64Array
from facade_core.export.bodies.openings import chart_outlines
from facade_core.export.models.textured_mesh import TexturedMesh

# Plane coordinate system: x along the wall to the right as seen from outside, y up from its foot.
PLANE_WKT = (
    'ENGCRS["Plane of a facade: metres along and up",EDATUM["Left end of its foot"],CS[Cartesian,2],'
    'AXIS["along (x)",east,ORDER[1]],AXIS["up (y)",north,ORDER[2]],LENGTHUNIT["metre",1]]'
)


@dataclass(frozen=True)
class WallPlane:
    """Pose of a wall's raster.

    Attributes
    ----------
    origin : (3,) left end of the foot, world metres.
    along, up, outward : (3,) unit vectors, world.
    height : height of the raster's upper edge above the foot, metres.
    texel_size : width and height of a texel, metres.
    """

    origin: Float64Array
    along: Float64Array
    up: Float64Array
    outward: Float64Array
    height: float
    texel_size: tuple[float, float]

    @property
    def transform(self) -> tuple[float, float, float, float, float, float]:
        """Return the affine transform from column and row to the plane, in GDAL's order for Python."""
        return (self.texel_size[0], 0.0, 0.0, 0.0, -self.texel_size[1], self.height)

    def pose(self) -> dict[str, list[float]]:
        """Return the pose as numbers by name: world = origin + x * along + y * up."""
        named = {"origin": self.origin, "along": self.along, "up": self.up, "outward": self.outward}
        return {name: (vector.round(6) + 0.0).tolist() for name, vector in named.items()}


def wall_plane(source: TexturedMesh, chart: int) -> WallPlane:
    """Return the plane of a chart's raster."""
    charts = source.charts
    height = float(charts.size[chart, 1])
    texel = source.extent[chart] / source.texels[chart]
    return WallPlane(
        charts.points(chart, np.zeros(1), np.array([height]))[0],
        charts.axis_u[chart],
        -charts.axis_v[chart],
        charts.normals()[chart],
        height,
        (float(texel[0]), float(texel[1])),
    )


def wall_outlines(source: TexturedMesh, chart: int) -> list[list[Float64Array]]:
    """Return the polygons of a chart as rings (k, 2) of raster columns and rows, exterior first."""
    corners = source.coordinates[source.mesh.triangles[source.mesh.chart_triangles(chart)]]
    scale = source.texels[chart] / source.extent[chart]
    return [
        [np.asarray(ring.coords) * scale for ring in (flat.exterior, *flat.interiors)]
        for flat in chart_outlines(corners)
    ]
