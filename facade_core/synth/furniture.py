"""Occluders of real streets that city models lack: cars, trees and people as plain bodies along a centreline."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import shapely

from facade_core.core.arrays import Float64Array, Int64Array
from facade_core.geometry.charts import Mesh

# Distances from the centreline, on either side.
CAR_OFFSET_M = 4.6
TREE_OFFSET_M = 6.2
PERSON_OFFSET_RANGE_M = (5.0, 7.5)
# Mean spacing along the street.
METRES_PER_CAR = 9.0
METRES_PER_TREE = 14.0
METRES_PER_PERSON = 11.0


def build_street_occluders(
    line: shapely.LineString, ground: Callable[[Float64Array], Float64Array], *, seed: int
) -> Mesh | None:
    """Build cars, trees and people along a street as one mesh with one chart per triangle.

    Parameters
    ----------
    line : centreline, world metres.
    ground : heights (n,) in metres of points (n, 2).
    seed : random seed.

    Returns
    -------
    mesh : None for a street that is too short.
    """
    rng = np.random.default_rng(seed)
    bodies: list[tuple[Float64Array, Int64Array]] = []
    for spacing, make in (
        (METRES_PER_CAR, _car_bodies),
        (METRES_PER_TREE, _tree_bodies),
        (METRES_PER_PERSON, _person_bodies),
    ):
        for along in rng.uniform(0, line.length, int(line.length / spacing)):
            aside, body = make(rng)
            place, ahead = _point_and_direction(line, float(along))
            left = np.array([-ahead[1], ahead[0]])
            at = place + (1 if rng.random() < 0.5 else -1) * aside * left
            turn = np.array([[ahead[0], -ahead[1], 0], [ahead[1], ahead[0], 0], [0, 0, 1]])
            foot = np.array([*at, float(ground(at[None])[0])])
            bodies += [(vertices @ turn.T + foot, triangles) for vertices, triangles in body]
    if not bodies:
        return None
    first = np.cumsum([0, *(len(vertices) for vertices, _ in bodies)])
    vertices = np.concatenate([vertices for vertices, _ in bodies])
    triangles = np.concatenate([triangles + start for (_, triangles), start in zip(bodies, first, strict=False)])
    each = np.arange(len(triangles), dtype=np.int32)
    return Mesh(vertices, triangles.astype(np.int32), each, np.zeros(len(vertices), np.int32))


def _point_and_direction(line: shapely.LineString, along: float) -> tuple[Float64Array, Float64Array]:
    """Return a point of the line and its unit direction there."""
    a, b = (np.array(line.interpolate(d).coords[0][:2]) for d in (max(along - 0.5, 0), min(along + 0.5, line.length)))
    step = b - a
    return (a + b) / 2, step / max(float(np.linalg.norm(step)), 1e-9)


def _car_bodies(rng: np.random.Generator) -> tuple[float, list[tuple[Float64Array, Int64Array]]]:
    length, width, height = rng.uniform(3.6, 5.0), rng.uniform(1.7, 1.95), rng.uniform(1.4, 1.9)
    body = _box((length, width, 0.55 * height), 0.3)
    cabin = _box((0.55 * length, 0.85 * width, 0.45 * height), 0.3 + 0.55 * height)
    wheels = [
        _ball((0.33, 0.12, 0.33), (x, y, 0.33))
        for x in (-0.3 * length, 0.3 * length)
        for y in (-0.5 * width, 0.5 * width)
    ]
    return CAR_OFFSET_M, [body, cabin, *wheels]


def _tree_bodies(rng: np.random.Generator) -> tuple[float, list[tuple[Float64Array, Int64Array]]]:
    trunk, crown = rng.uniform(2.0, 3.5), rng.uniform(1.2, 2.4)
    parts = [_box((0.3, 0.3, trunk + crown), 0.0)]
    for _ in range(5):
        off = rng.normal(0, 0.45 * crown, 3)
        parts.append(_ball((0.75 * crown,) * 3, (off[0], off[1], trunk + crown + off[2])))
    return TREE_OFFSET_M, parts


def _person_bodies(rng: np.random.Generator) -> tuple[float, list[tuple[Float64Array, Int64Array]]]:
    tall = rng.uniform(1.5, 1.9)
    parts = [_ball((0.16, 0.24, 0.42 * tall), (0, 0, 0.42 * tall)), _ball((0.11, 0.1, 0.13), (0, 0, 0.93 * tall))]
    return float(rng.uniform(*PERSON_OFFSET_RANGE_M)), parts


def _box(size: tuple[float, float, float], bottom: float) -> tuple[Float64Array, Int64Array]:
    import trimesh

    box = trimesh.creation.box(size)
    return box.vertices + np.array([0, 0, bottom + size[2] / 2]), box.faces


def _ball(radii: tuple[float, float, float], centre: tuple[float, float, float]) -> tuple[Float64Array, Int64Array]:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=1)
    return ball.vertices * radii + centre, ball.faces
