"""What is drawn beside a building's closed surfaces: planar polygons, a chart each."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from facade_core.geometry.facets import Facets


class Trim(NamedTuple):
    """Facets that are drawn beside a roof, and the directions (f, 3) of their charts' right."""

    facets: Facets
    along: np.ndarray


class Faces:
    """Collects planar polygons, a facet each."""

    def __init__(self) -> None:
        self._kinds: list[int] = []
        self._corners: list[list[np.ndarray]] = []
        self._along: list[np.ndarray] = []

    def add(self, kind: int, corners: list[np.ndarray], along: np.ndarray | None = None) -> None:
        """corners: three or more (3,), convex, counter-clockwise seen from outside; the first two along the chart's right, if
        that (3,) is not given."""
        self._kinds.append(kind)
        self._corners.append(corners)
        self._along.append(corners[1] - corners[0] if along is None else along)

    def trim(self) -> Trim:
        """The longest first: those that follow share its chunks."""
        order = np.argsort([-np.linalg.norm(own[1] - own[0]) for own in self._corners], kind="stable")
        kinds, faces = np.array(self._kinds, np.uint8)[order], [self._corners[i] for i in order]
        first = np.cumsum([0, *map(len, faces)])
        fans = [[(0, k, k + 1) for k in range(1, len(own) - 1)] for own in faces]
        triangles = np.concatenate([np.array(fan) + start for fan, start in zip(fans, first[:-1], strict=True)])
        normal = np.array([normal_of(own[0], own[1], own[2]) for own in faces])
        along = np.array([self._along[i] for i in order])
        count = len(triangles)
        found = Facets(
            vertices=np.concatenate([np.array(own) for own in faces]),
            triangles=triangles,
            facet=np.repeat(np.arange(len(fans)), list(map(len, fans))),
            texture=np.full(count, -1, np.int32),
            uv=np.zeros((count, 3, 2), np.float32),
            kind=kinds,
            normal=normal,
        )
        return Trim(found, along / np.linalg.norm(along, axis=1, keepdims=True))


def normal_of(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """The direction (3,) that a triangle faces, its corners counter-clockwise."""
    normal = np.cross(b - a, c - a)
    return normal / np.linalg.norm(normal)
