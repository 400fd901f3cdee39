"""Details outside the closed surface of a building: polygons on a chart each, or bent strips on a common chart."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import Float64Array
from facade_core.core.fixed_order import dot_product, vector_length
from facade_core.geometry.buildings.facets import Facets


class RoofDetail(NamedTuple):
    """Facets outside the closed surface, and the right axes (f, 3) of their charts."""

    facets: Facets
    along: Float64Array


class RoofDetailBuilder:
    """Collector of the polygons of a detail."""

    def __init__(self) -> None:
        self._kinds: list[int] = []
        self._polygons: list[list[list[Float64Array]]] = []
        self._along: list[Float64Array] = []
        self._normals: list[Float64Array] = []

    def add_polygon(self, kind: int, corners: list[Float64Array], along: Float64Array | None = None) -> None:
        """Add a polygon as one chart.

        Parameters
        ----------
        kind : `ChartKind`.
        corners : three or more (3,), convex, counter-clockwise from outside.
        along : (3,) right axis of the chart; default is the first edge.
        """
        self._add(kind, [corners], corners[1] - corners[0] if along is None else along, triangle_normal(*corners[:3]))

    def add_bent_strip(self, kind: int, polygons: list[list[Float64Array]], along: Float64Array) -> None:
        """Add polygons on one mean chart, whose plane they leave by centimetres at most.

        Parameters
        ----------
        kind : `ChartKind`.
        polygons : corners as in `add_polygon`, all facing one side.
        along : (3,) right axis of the chart.
        """
        total = sum(
            (np.cross(b - a, c - a) for corners in polygons for a, b, c in _fan_triangles(corners)), start=np.zeros(3)
        )
        total -= dot_product(total, along) / dot_product(along, along) * along
        self._add(kind, polygons, along, total / vector_length(total))

    def _add(self, kind: int, polygons: list[list[Float64Array]], along: Float64Array, normal: Float64Array) -> None:
        self._kinds.append(kind)
        self._polygons.append(polygons)
        self._along.append(along)
        self._normals.append(normal)

    def build(self) -> RoofDetail:
        """Return the detail, longest facets first, so that shorter ones share their chunks."""
        order = np.argsort([-vector_length(own[0][1] - own[0][0]) for own in self._polygons], kind="stable").tolist()
        vertices: list[Float64Array] = []
        triangles: list[tuple[int, int, int]] = []
        facet: list[int] = []
        for number, i in enumerate(order):
            for corners in self._polygons[i]:
                first = len(vertices)
                vertices += corners
                triangles += [(first, first + k, first + k + 1) for k in range(1, len(corners) - 1)]
                facet += [number] * (len(corners) - 2)
        along = np.array([self._along[i] for i in order])
        count = len(triangles)
        found = Facets(
            vertices=np.array(vertices),
            triangles=np.array(triangles),
            facet=np.array(facet),
            texture=np.full(count, -1, np.int32),
            uv=np.zeros((count, 3, 2), np.float32),
            kind=np.array(self._kinds, np.uint8)[order],
            normal=np.array([self._normals[i] for i in order]),
        )
        return RoofDetail(found, along / np.linalg.norm(along, axis=1, keepdims=True))


def _fan_triangles(corners: list[Float64Array]) -> list[tuple[Float64Array, Float64Array, Float64Array]]:
    """Return the triangles of a convex polygon."""
    return [(corners[0], corners[k], corners[k + 1]) for k in range(1, len(corners) - 1)]


def triangle_normal(a: Float64Array, b: Float64Array, c: Float64Array) -> Float64Array:
    """Return the unit normal (3,) of a counter-clockwise triangle with corners (3,)."""
    normal = np.cross(b - a, c - a)
    return normal / vector_length(normal)
