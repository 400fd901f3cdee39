"""Walls that modelled shells lack: party walls, gables, sides below roofs; and what stays open on purpose."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
import shapely

from facade_core.core.types import SEMANTICS, BuildingShell
from facade_core.geometry.buildings.closing import concatenate_facets, missing_walls, open_edge_mask
from facade_core.geometry.buildings.facets import Facets, extract_shell_facets

FOOT = [[0.0, 0, 0], [0, 4, 0], [6, 4, 0], [6, 0, 0]]
NORTH = [[6.0, 4, 0], [0, 4, 0], [0, 4, 3], [6, 4, 3]]
SOUTH = [[0.0, 0, 0], [6, 0, 0], [6, 0, 3], [0, 0, 3]]
WEST = [[0.0, 4, 0], [0, 0, 0], [0, 0, 3], [0, 2, 5], [0, 4, 3]]
GABLE = [[6.0, 0, 3], [6, 4, 3], [6, 2, 5]]
SLOPES = [[[0.0, 0, 3], [6, 0, 3], [6, 2, 5], [0, 2, 5]], [[6.0, 4, 3], [0, 4, 3], [0, 2, 5], [6, 2, 5]]]
PLAN = shapely.box(0, 0, 6, 4)


def collect_facets(polygons: Sequence[tuple[str, Sequence[Sequence[float]]]], plan: shapely.Polygon = PLAN) -> Facets:
    vertices, triangles, semantic = [], [], []
    for name, ring in polygons:
        first = len(vertices)
        vertices += ring
        fans = [[first, first + k, first + k + 1] for k in range(1, len(ring) - 1)]
        triangles += fans
        semantic += [SEMANTICS.index(name)] * len(fans)
    n = len(triangles)
    shell = BuildingShell(
        np.array(vertices, float),
        np.array(triangles, np.int32),
        np.array(semantic, np.uint8),
        np.full(n, -1, np.int32),
        np.zeros((n, 3, 2), np.float32),
    )
    return extract_shell_facets(shell, plan)


def house(*walls: Sequence[Sequence[float]], roofs: Sequence[Sequence[Sequence[float]]] = SLOPES) -> Facets:
    return collect_facets([("ground", FOOT), *(("wall", wall) for wall in walls), *(("roof", roof) for roof in roofs)])


def open_metres(facets: Facets) -> float:
    """Length of the open edges above the foot."""
    edges, is_open = open_edge_mask(facets)
    ends = facets.vertices[edges[is_open]]
    above = ends[..., 2].max(axis=1) > facets.vertices[facets.triangles][..., 2].min() + 0.01
    return float(np.linalg.norm(ends[above, 1] - ends[above, 0], axis=1).sum())


def test_a_house_without_its_party_wall_gets_one() -> None:
    facets = house(NORTH, SOUTH, WEST)
    missing = missing_walls(facets)
    assert missing is not None
    np.testing.assert_allclose(missing.normal, [[1, 0, 0]], atol=1e-9)
    corners = missing.vertices[missing.triangles]
    area = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).sum(axis=0)
    np.testing.assert_allclose(area, [4 * 3 + 4, 0, 0], atol=1e-6)
    assert open_metres(facets) > 10
    assert open_metres(concatenate_facets(facets, missing)) == pytest.approx(0, abs=1e-6)


def test_below_a_gable_only_what_is_missing_is_added() -> None:
    missing = missing_walls(house(NORTH, SOUTH, WEST, GABLE))
    assert missing is not None
    corners = missing.vertices[missing.triangles]
    area = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).sum(axis=0)
    np.testing.assert_allclose(area, [12, 0, 0], atol=1e-6)


def test_a_closed_house_gets_nothing() -> None:
    east = [[6.0, 0, 0], [6, 4, 0], [6, 4, 3], [6, 2, 5], [6, 0, 3]]
    assert missing_walls(house(NORTH, SOUTH, WEST, east)) is None


def test_an_overhanging_roof_and_a_roof_on_posts_stay_open() -> None:
    east = [[6.0, 0, 0], [6, 4, 0], [6, 4, 3], [6, 2, 5], [6, 0, 3]]
    wide = [
        [[-0.6, -0.6, 2.4], [6.6, -0.6, 2.4], [6.6, 2, 5], [-0.6, 2, 5]],
        [[6.6, 4.6, 2.4], [-0.6, 4.6, 2.4], [-0.6, 2, 5], [6.6, 2, 5]],
    ]
    assert missing_walls(house(NORTH, SOUTH, WEST, east, roofs=wide)) is None
    assert missing_walls(collect_facets([("ground", FOOT), *(("roof", roof) for roof in SLOPES)])) is None
