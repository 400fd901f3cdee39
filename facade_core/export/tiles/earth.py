"""Georeference of 3D Tiles: in the earth-centred frame, or in a block's projected frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from facade_core.core.arrays import Float64Array
from facade_core.export.models.textured_mesh import ModelFrame, YUpFrame, to_y_up


class TilesetFrame(ModelFrame, Protocol):
    """Frame of a tileset's models, with its place in the coordinates of the tileset."""

    def transform(self) -> Float64Array:
        """Return the matrix (4, 4) from the frame, z up, to the coordinates of the tileset."""
        ...


@dataclass(frozen=True)
class ProjectedFrame(YUpFrame):
    """Frame along the axes of a block's projected CRS, in which the tileset has its coordinates."""

    def transform(self) -> Float64Array:
        """Return the matrix (4, 4) from the frame to the projected CRS: a translation."""
        matrix = np.eye(4)
        matrix[:3, 3] = self.origin
        return matrix


@dataclass(frozen=True)
class EarthTangentFrame:
    """Local east-north-up frame at a point of a block.

    Every point passes through the earth-centred frame, so that neither the scale of the projection nor the curvature of the
    earth displaces it.

    Attributes
    ----------
    to_earth_centred : maps world points (n, 3) to earth-centred metres (EPSG:4978).
    centre : (3,) origin of the frame, earth-centred metres.
    axes : (3, 3) rows east, north and up.
    grid_convergence : angle from true to grid north, clockwise, radians.
    """

    to_earth_centred: Callable[[Float64Array], Float64Array]
    centre: Float64Array
    axes: Float64Array
    grid_convergence: float

    def transform(self) -> Float64Array:
        """Return the matrix (4, 4) from the frame to the earth-centred frame."""
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = self.axes.T, self.centre
        return matrix

    def points(self, world: Float64Array) -> Float64Array:
        """Return points (n, 3) of the world in the frame, y up, metres."""
        return to_y_up((self.to_earth_centred(world) - self.centre) @ self.axes.T)

    def directions(self, world: Float64Array) -> Float64Array:
        """Rotate directions (n, 3) from grid to true north at the origin."""
        x, y, z = world.T
        c, s = np.cos(self.grid_convergence), np.sin(self.grid_convergence)
        return to_y_up(np.column_stack([c * x + s * y, c * y - s * x, z]))


def earth_tangent_frame(crs: str, origin: Float64Array, geoid_separation: float = 0.0) -> EarthTangentFrame:
    """Build the local tangent frame of the earth at a point of a block.

    Parameters
    ----------
    crs : horizontal reference system, as text that pyproj reads.
    origin : (3,) world metres.
    geoid_separation : metres to add to heights for heights over the ellipsoid.
    """
    from pyproj import Transformer

    to_degrees = Transformer.from_crs(crs, "EPSG:4326", always_xy=True)
    to_earth = Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)

    def earth_centred(world: Float64Array) -> Float64Array:
        degrees = to_degrees.transform(world[:, 0], world[:, 1])
        return np.column_stack(to_earth.transform(*degrees, world[:, 2] + geoid_separation))

    longitude, latitude = np.radians(to_degrees.transform(*origin[:2]))
    east = np.array([-np.sin(longitude), np.cos(longitude), 0.0])
    up = np.array([np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)])
    axes = np.stack([east, np.cross(up, east), up])
    # the angle between grid north and true north, over 100 m
    centre, ahead = earth_centred(np.stack([origin, origin + np.array([0.0, 100.0, 0.0])]))
    x, y, _ = axes @ (ahead - centre)
    return EarthTangentFrame(earth_centred, centre, axes, float(np.arctan2(x, y)))
