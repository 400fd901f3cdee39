"""Recessed windows and doors with reveals, as deep as the space behind the wall allows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from shapely import Polygon

from facade_core.core.arrays import BoolArray, Float64Array
from facade_core.export.bodies.settings import WALL_OPENINGS
from facade_core.geometry.charts import Charts


class RecessedOpening(NamedTuple):
    """Opening set back in a wall.

    Attributes
    ----------
    ring : (k, 3) outline in the wall, counter-clockwise as seen from outside, world metres.
    chart_ring : (k, 2) the same in the chart's frame.
    depth : distance behind the wall, metres.
    inward : (3,) unit vector into the wall.
    """

    ring: Float64Array
    chart_ring: Float64Array
    depth: float
    inward: Float64Array

    @property
    def pane_ring(self) -> Float64Array:
        """Return the outline (k, 3) of the opening itself."""
        return self.ring + self.depth * self.inward

    def triangles(self) -> Float64Array:
        """Return the triangles (t, 3, 3) of the opening and its reveals, which later openings must not meet."""
        return np.concatenate([_fan(self.pane_ring), *(_fan(quad) for quad, _ in self.reveals())])

    def reveals(self) -> list[tuple[Float64Array, Float64Array]]:
        """Return the faces between wall and opening.

        Returns
        -------
        Corners (4, 3), and the places (4, 2) on the chart that a face shows: the wall next to the opening, mirrored.
        """
        if not self.depth:
            return []
        found = []
        for k in range(len(self.ring)):
            one, other = k, (k + 1) % len(self.ring)
            along = self.chart_ring[other] - self.chart_ring[one]
            # y is down, so the outside of a ring that is counter-clockwise to a viewer is on the left in the frame
            away = np.array([-along[1], along[0]]) / np.linalg.norm(along) * self.depth
            flat = np.array(
                [
                    self.chart_ring[one],
                    self.chart_ring[other],
                    self.chart_ring[other] + away,
                    self.chart_ring[one] + away,
                ]
            )
            pane = self.pane_ring
            found.append((np.array([self.ring[one], self.ring[other], pane[other], pane[one]]), flat))
        return found


def _fan(ring: Float64Array) -> Float64Array:
    return np.stack([np.array([ring[0], ring[k], ring[k + 1]]) for k in range(1, len(ring) - 1)])


def recess_opening(
    opening: Polygon, depth: float, charts: Charts, chart: int, wall: Float64Array, behind: list[Float64Array]
) -> RecessedOpening:
    """Recess an opening by its depth, or less deep if there is no room.

    Parameters
    ----------
    opening : outline in the chart's frame.
    depth : depth of the opening, metres.
    charts : charts of the mesh.
    chart : chart of the wall.
    wall : (k, 3) corners of the wall polygon, whose plane the opening takes.
    behind : triangles (t, 3, 3) of all other surfaces of the building.
    """
    flat = np.asarray(opening.exterior.coords)[:-1]
    points, out = project_on_wall(charts, chart, wall, flat), charts.normals()[chart]
    for inward in (depth, WALL_OPENINGS.shallow_recess_m):
        if has_room(opening, -inward, charts, chart, points[0], behind):
            return RecessedOpening(points, flat, inward, -out)
    return RecessedOpening(points, flat, 0.0, -out)


def project_on_wall(charts: Charts, chart: int, wall: Float64Array, flat: Float64Array) -> Float64Array:
    """Project places (n, 2) of a chart's frame on the mean plane of a wall polygon (k, 3), (n, 3)."""
    points, out = charts.points(chart, *flat.T), charts.normals()[chart]
    middle = wall.mean(axis=0)
    _, _, axes = np.linalg.svd(wall - middle, full_matrices=False)
    normal = axes[2]
    points += np.outer((middle - points) @ normal / (out @ normal), out)
    return points


def has_room(
    element: Polygon, outward: float, charts: Charts, chart: int, point: Float64Array, others: list[Float64Array]
) -> bool:
    """Return True if no surface is in the box between an element in its wall and in its depth.

    Parameters
    ----------
    element : outline in the chart's frame.
    outward : metres before the wall; negative behind it.
    charts : charts of the mesh.
    chart : chart of the wall.
    point : (3,) point of the wall's plane.
    others : triangles (t, 3, 3) of surfaces.
    """
    out, clearance = charts.normals()[chart], WALL_OPENINGS.min_recess_clearance_m
    side = 1.0 if outward > 0 else -1.0
    frame = np.stack([charts.axis_u[chart], charts.axis_v[chart], side * out])
    origin = charts.origin[chart] + out * ((point - charts.origin[chart]) @ out)
    x0, y0, x1, y1 = element.bounds
    low, high = np.array([x0, y0, clearance]), np.array([x1, y1, abs(outward) + clearance])
    box = (low + high) / 2, (high - low) / 2
    return not any(intersects_box((triangles - origin) @ frame.T, *box).any() for triangles in others)


def intersects_box(triangles: Float64Array, centre: Float64Array, half: Float64Array) -> BoolArray:
    """Test which triangles intersect an axis-aligned box, by separating axes.

    Parameters
    ----------
    triangles : (t, 3, 3) corners.
    centre : (3,) centre of the box.
    half : (3,) half sides of the box.

    Returns
    -------
    (t,) bool.

    References
    ----------
    Akenine-Moeller, "Fast 3D Triangle-Box Overlap Testing", 2001.
    """
    met: BoolArray = ((triangles.min(axis=1) <= centre + half) & (triangles.max(axis=1) >= centre - half)).all(axis=1)
    if not met.any():
        return met
    corners = triangles[met] - centre
    sides = np.roll(corners, -1, axis=1) - corners
    normal = np.cross(sides[:, 0], sides[:, 1])
    axes = [normal, *(np.cross(sides[:, k], unit) for k in range(3) for unit in np.eye(3))]
    parted = np.zeros(len(corners), bool)
    for axis in axes:
        shadow = np.einsum("tcj,tj->tc", corners, axis)
        reach = np.abs(axis) @ half
        parted |= (shadow.min(axis=1) > reach) | (shadow.max(axis=1) < -reach)
    met[met] = ~parted
    return met
