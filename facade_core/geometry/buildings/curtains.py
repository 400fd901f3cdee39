"""Walls below open edges of a shell: missing party walls, and plinths on slopes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from shapely import Polygon

from facade_core.core.arrays import Float64Array
from facade_core.core.fixed_order import dot_product
from facade_core.geometry.buildings.settings import CURTAINS

Edge = tuple[Float64Array, Float64Array]


class Curtain(NamedTuple):
    """Upright wall from open edges down to a level.

    Attributes
    ----------
    origin : (2,) point of its line.
    along : (2,) unit vector of the line.
    base : height of the level.
    shape : metres along the line and over the level; clockwise where the outside is on the left of `along`.
    """

    origin: Float64Array
    along: Float64Array
    base: float
    shape: Polygon

    def rings(self) -> list[Float64Array]:
        """Return the corners (k, 3) of its rings, exterior first, counter-clockwise from outside."""
        return [self.points(np.asarray(ring.coords)[:-1]) for ring in (self.shape.exterior, *self.shape.interiors)]

    def points(self, flat: Float64Array) -> Float64Array:
        """Place points (k, 2) of the shape in the world, (k, 3)."""
        return np.column_stack([self.origin + flat[:, :1] * self.along, self.base + flat[:, 1]])


def curtains_below_edges(edges: Sequence[Edge], base: float) -> list[Curtain]:
    """Compute the walls from the open edges of a shell down to a level.

    Between the top and the bottom edge of a hole there is no wall.

    Parameters
    ----------
    edges : start and end (3,) of the missing polygons' edges, opposite to those of the shell; metres.
    base : height of the level.
    """
    chosen = [(a, b) for a, b in edges if max(a[2], b[2]) > base and np.hypot(*(b - a)[:2]) > CURTAINS.min_curtain_m]
    return [curtain for own in _group_collinear_edges(chosen) for curtain in _curtains_on_line(own, base)]


def _group_collinear_edges(edges: Sequence[Edge]) -> list[list[Edge]]:
    """Group edges over one line seen from above, longest first."""
    lines: list[list[Edge]] = []
    for edge in sorted(edges, key=lambda edge: -float(np.hypot(*(edge[1] - edge[0])[:2]))):
        for own in lines:
            start, run = own[0][0][:2], (own[0][1] - own[0][0])[:2]
            across = np.array([-run[1], run[0]]) / np.hypot(*run)
            if all(abs(dot_product(end[:2] - start, across)) < CURTAINS.max_off_line_m for end in edge):
                own.append(edge)
                break
        else:
            lines.append([edge])
    return lines


def _curtains_on_line(edges: Sequence[Edge], base: float) -> list[Curtain]:
    """Return the walls below edges over one line down to `base`; areas below edges of both directions cancel."""
    origin, along = edges[0][0][:2], (edges[0][1] - edges[0][0])[:2]
    along = along / np.hypot(*along)
    below: dict[bool, list[Polygon]] = {True: [], False: []}
    for start, end in edges:
        (x0, x1), (z0, z1) = (
            (dot_product(p[:2] - origin, along) for p in (start, end)),
            (start[2] - base, end[2] - base),
        )
        if abs(x1 - x0) > CURTAINS.grid_m:
            below[x1 > x0].append(Polygon([(x0, z0), (x1, z1), (x1, 0.0), (x0, 0.0)]))
    walls = {way: shapely.union_all(own, grid_size=CURTAINS.grid_m) for way, own in below.items()}
    curtains = []
    for way in (True, False):
        for part in shapely.get_parts(shapely.difference(walls[way], walls[not way], grid_size=CURTAINS.grid_m)):
            if part.geom_type == "Polygon" and part.area >= CURTAINS.min_curtain_m**2:
                # the edge on top runs along the line where `way`: clockwise in its plane
                curtains.append(Curtain(origin, along, base, shapely.orient_polygons(part, exterior_cw=way)))
    return curtains
