"""Recessed windows and doors with reveals, as deep as the space behind the wall allows."""

from __future__ import annotations

from collections.abc import Sequence
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


class WallSpace:
    """Mean plane of a wall polygon, and the surfaces before and behind it that its elements must not meet.

    Parameters
    ----------
    charts : charts of the mesh.
    chart : chart of the wall.
    wall : (k, 3) corners of the wall polygon, whose plane the elements take.
    others : triangles (t, 3, 3) of surfaces.
    """

    def __init__(self, charts: Charts, chart: int, wall: Float64Array, others: Sequence[Float64Array]) -> None:
        self.charts, self.chart, self.out = charts, chart, charts.normals()[chart]
        self._middle = wall.mean(axis=0)
        _, _, axes = np.linalg.svd(wall - self._middle, full_matrices=False)
        self._normal = axes[2]
        axes = np.stack([charts.axis_u[chart], charts.axis_v[chart], self.out])
        self._others = (np.concatenate([np.zeros((0, 3, 3)), *others]) - charts.origin[chart]) @ axes.T

    def points(self, flat: Float64Array) -> Float64Array:
        """Project places (n, 2) of the chart's frame on the plane, (n, 3)."""
        points = self.charts.points(self.chart, *flat.T)
        points += np.outer((self._middle - points) @ self._normal / (self.out @ self._normal), self.out)
        return points

    def has_room(self, boxes: Float64Array, outward: Float64Array) -> BoolArray:
        """Return where no surface is in the space between an element in its wall and in its depth.

        Parameters
        ----------
        boxes : (n, 4) least x and y and greatest x and y of elements in the chart's frame.
        outward : (n,) metres before the wall; negative behind it.
        """
        met = np.zeros(len(boxes), bool)
        height = (self.points(boxes[:, :2]) - self.charts.origin[self.chart]) @ self.out
        ends = height + np.sign(outward) * WALL_OPENINGS.min_recess_clearance_m
        low = np.column_stack([boxes[:, :2], np.minimum(ends, ends + outward)])
        high = np.column_stack([boxes[:, 2:], np.maximum(ends, ends + outward)])
        first, last = self._others.min(axis=1), self._others.max(axis=1)
        is_near = ((first <= high.max(axis=0, initial=-np.inf)) & (last >= low.min(axis=0, initial=np.inf))).all(axis=1)
        first, last, near = first[is_near], last[is_near], self._others[is_near]
        element, other = np.nonzero(((first <= high[:, None]) & (last >= low[:, None])).all(axis=-1))
        middle, half = (low + high)[element] / 2, (high - low)[element] / 2
        met[element[intersects_box(near[other], middle, half)]] = True
        return ~met

    def recess_depths(self, boxes: Float64Array, depths: Float64Array) -> Float64Array:
        """Return depths (n,) of openings: their own, or less where there is no room, or 0.

        Parameters
        ----------
        boxes : (n, 4) as in `has_room`.
        depths : (n,) depth of each opening, metres.
        """
        shallow = np.minimum(depths, WALL_OPENINGS.shallow_recess_m)
        has_shallow = (depths > 0) & self.has_room(boxes, -shallow)
        return np.where(self.has_room(boxes, -depths), depths, np.where(has_shallow, shallow, 0.0))


def recess_opening(opening: Polygon, depth: float, space: WallSpace) -> RecessedOpening:
    """Recess an opening by its depth, or less deep if there is no room.

    Parameters
    ----------
    opening : outline in the chart's frame.
    depth : depth of the opening, metres.
    space : plane of the wall, and the surfaces behind it.
    """
    flat = np.asarray(opening.exterior.coords)[:-1]
    (inward,) = space.recess_depths(np.array([opening.bounds]), np.array([depth])).tolist()
    return RecessedOpening(space.points(flat), flat, inward, -space.out)


def intersects_box(triangles: Float64Array, centre: Float64Array, half: Float64Array) -> BoolArray:
    """Test which triangles intersect axis-aligned boxes, by separating axes.

    Parameters
    ----------
    triangles : (t, 3, 3) corners.
    centre : (3,) or (t, 3) centre of the box, or that of each triangle.
    half : (3,) or (t, 3) half sides.

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
    centre, half = (np.broadcast_to(side, (len(triangles), 3))[met] for side in (centre, half))
    corners = triangles[met] - centre[:, None]
    sides = np.roll(corners, -1, axis=1) - corners
    normal = np.cross(sides[:, 0], sides[:, 1])
    axes = [normal, *(np.cross(sides[:, k], unit) for k in range(3) for unit in np.eye(3))]
    parted = np.zeros(len(corners), bool)
    for axis in axes:
        shadow = np.einsum("tcj,tj->tc", corners, axis)
        reach = (np.abs(axis) * half).sum(axis=1)
        parted |= (shadow.min(axis=1) > reach) | (shadow.max(axis=1) < -reach)
    met[met] = ~parted
    return met
