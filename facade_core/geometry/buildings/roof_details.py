"""What is drawn beside a building's closed surfaces: polygons, a chart each, or several that bend about the plane of one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from facade_core.geometry.buildings.facets import Facets


class Trim(NamedTuple):
    """Facets that are drawn beside a roof, and the directions (f, 3) of their charts' right."""

    facets: Facets
    along: np.ndarray


class Faces:
    """Collects polygons by facets."""

    def __init__(self) -> None:
        self._kinds: list[int] = []
        self._polygons: list[list[list[np.ndarray]]] = []
        self._along: list[np.ndarray] = []
        self._normals: list[np.ndarray] = []

    def add(self, kind: int, corners: list[np.ndarray], along: np.ndarray | None = None) -> None:
        """corners: three or more (3,), convex, counter-clockwise seen from outside; the first two along the chart's right, if
        that (3,) is not given."""
        self._add(kind, [corners], corners[1] - corners[0] if along is None else along, normal_of(*corners[:3]))

    def bend(self, kind: int, polygons: list[list[np.ndarray]], along: np.ndarray) -> None:
        """Polygons as of `add` on one chart, which lies between them: they leave its plane by no more than centimetres, and all
        face its side. along (3,): the chart's right."""
        total = sum((np.cross(b - a, c - a) for corners in polygons for a, b, c in _fan(corners)), start=np.zeros(3))
        total -= (total @ along) / (along @ along) * along
        self._add(kind, polygons, along, total / np.linalg.norm(total))

    def _add(self, kind: int, polygons: list[list[np.ndarray]], along: np.ndarray, normal: np.ndarray) -> None:
        self._kinds.append(kind)
        self._polygons.append(polygons)
        self._along.append(along)
        self._normals.append(normal)

    def trim(self) -> Trim:
        """The longest first: those that follow share its chunks."""
        order = np.argsort([-np.linalg.norm(own[0][1] - own[0][0]) for own in self._polygons], kind="stable").tolist()
        vertices: list[np.ndarray] = []
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
        return Trim(found, along / np.linalg.norm(along, axis=1, keepdims=True))


def _fan(corners: list[np.ndarray]) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """The triangles of a convex polygon."""
    return [(corners[0], corners[k], corners[k + 1]) for k in range(1, len(corners) - 1)]


def normal_of(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """The direction (3,) that a triangle faces, its corners counter-clockwise."""
    normal = np.cross(b - a, c - a)
    return normal / np.linalg.norm(normal)
