"""Triangles into planar facets that face outward, whatever their winding."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from facade_core.core.errors import GeometryError
from facade_core.core.types import SEMANTICS, BuildingShell
from facade_core.geometry.buildings.facets import extract_shell_facets
from facade_core.geometry.charts import ChartKind

UNKNOWN = SEMANTICS.index("unknown")


def box(x0: float, y0: float, z0: float, x1: float, y1: float, z1: float) -> np.ndarray:
    """Twelve triangles (12, 3, 3) of a box, counter-clockwise seen from outside."""
    import trimesh

    mesh = trimesh.creation.box(bounds=[[x0, y0, z0], [x1, y1, z1]])
    return np.array(mesh.triangles)


def shell(corners: np.ndarray, semantic: int | np.ndarray = UNKNOWN) -> BuildingShell:
    return BuildingShell(
        vertices=corners.reshape(-1, 3).astype(np.float64),
        triangles=np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3),
        semantic=np.broadcast_to(np.asarray(semantic, np.uint8), len(corners)).copy(),
        texture=np.full(len(corners), -1, np.int32),
        uv=np.random.default_rng(0).random((len(corners), 3, 2)).astype(np.float32),
    )


@pytest.mark.parametrize("seed", [None, 0, 1])
def test_a_box_has_four_walls_and_a_roof_outward_in_any_winding(seed: int | None) -> None:
    corners = box(0, 0, 3, 20, 10, 9)
    if seed is not None:
        rng = np.random.default_rng(seed)
        turn = rng.random(12) < 0.5
        corners[turn] = corners[turn][:, ::-1]
        corners = corners[rng.permutation(12)]
    found = extract_shell_facets(shell(corners), shapely.box(0, 0, 20, 10))
    assert sorted(found.kind.tolist()) == [ChartKind.WALL] * 4 + [ChartKind.ROOF]
    assert sorted(map(tuple, found.normal.round(6).tolist())) == [
        (-1, 0, 0), (0, -1, 0), (0, 0, 1), (0, 1, 0), (1, 0, 0)
    ]  # fmt: skip
    tri = found.vertices[found.triangles]
    normal = np.cross(tri[:, 1] - tri[:, 0], tri[:, 2] - tri[:, 0])
    assert (np.einsum("ij,ij->i", normal, found.normal[found.facet]) > 0).all()
    assert len(found.vertices) == 8


def test_texture_coordinates_follow_their_corners() -> None:
    corners = box(0, 0, 0, 20, 10, 9)
    corners[::2] = corners[::2][:, ::-1]
    source = shell(corners)
    found = extract_shell_facets(source, shapely.box(0, 0, 20, 10))
    place = {tuple(p): set() for p in found.vertices.tolist()}
    for points, uvs in zip(corners, source.uv, strict=True):
        for p, uv in zip(points, uvs, strict=True):
            place[tuple(p.tolist())].add(tuple(uv.tolist()))
    for triangle, uvs in zip(found.triangles, found.uv, strict=True):
        for v, uv in zip(triangle, uvs, strict=True):
            assert tuple(uv.tolist()) in place[tuple(found.vertices[v].tolist())]


def test_walls_inside_the_footprint_are_told_by_what_lies_on_both_sides() -> None:
    """A tower on a wider base: its walls stand inside the outline."""
    import trimesh

    tower = trimesh.creation.box(bounds=[[6, 3, 0], [12, 7, 20]])
    base = trimesh.creation.box(bounds=[[0, 0, 0], [20, 10, 9]])
    corners = np.concatenate([base.triangles, tower.triangles[:, ::-1]])
    found = extract_shell_facets(shell(corners), shapely.box(0, 0, 20, 10))
    middle = np.array(
        [found.vertices[found.triangles[found.facet == f]].reshape(-1, 3).mean(axis=0) for f in range(len(found))]
    )
    walls = found.kind == ChartKind.WALL
    assert walls.sum() == 8
    away = (middle - [9, 5, 0])[walls, :2]
    assert (np.einsum("ij,ij->i", away, found.normal[walls, :2]) > 0).all()


def test_a_party_wall_above_the_roof_faces_the_lower_house() -> None:
    """Given with the lower house, as some cities do: winding tells, since the footprint does not."""
    low = box(0, 0, 0, 20, 10, 5)
    west = (low[..., 0] == 0).all(axis=1)
    wall = low[west][:, ::-1].copy()
    wall[..., 2] *= 3
    found = extract_shell_facets(shell(np.concatenate([low[~west], wall])), shapely.box(0, 0, 20, 10))
    x = np.array([found.vertices[found.triangles[found.facet == f]][..., 0].max() for f in range(len(found))])
    assert found.normal[x == 0].round(6).tolist() == [[1, 0, 0]]
    assert (found.kind == ChartKind.WALL).sum() == 4


def test_an_overhang_has_a_ceiling_and_the_underside_is_left_out() -> None:
    import trimesh

    stem = trimesh.creation.box(bounds=[[0, 0, 0], [10, 10, 4]])
    slab = trimesh.creation.box(bounds=[[0, 0, 4.2], [14, 10, 8]])
    found = extract_shell_facets(shell(np.concatenate([stem.triangles, slab.triangles])), shapely.box(0, 0, 14, 10))
    ceiling = found.kind == ChartKind.CEILING
    assert ceiling.sum() == 1
    assert found.normal[ceiling][0].tolist() == [0, 0, -1]
    assert (found.kind == ChartKind.ROOF).sum() == 2
    assert found.vertices[found.triangles][..., 2].max(axis=1).min() > 3.9


def test_semantics_keep_facets_apart_and_decide_their_kind() -> None:
    corners = box(0, 0, 0, 20, 10, 9)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    semantic = np.full(12, UNKNOWN)
    south = np.flatnonzero(normal[:, 1] < -1)
    semantic[south[0]] = SEMANTICS.index("window")
    found = extract_shell_facets(shell(corners, semantic), shapely.box(0, 0, 20, 10))
    facing = found.normal[:, 1] < -0.9
    assert sorted(found.kind[facing].tolist()) == [ChartKind.WALL, ChartKind.WINDOW]


def test_what_stands_upright_is_a_wall_whatever_its_source_calls_it() -> None:
    corners = box(0, 0, 0, 20, 10, 9)
    found = extract_shell_facets(shell(corners, SEMANTICS.index("roof")), shapely.box(0, 0, 20, 10))
    upright = np.abs(found.normal[:, 2]) < 0.5
    assert (found.kind[upright] == ChartKind.WALL).all()
    assert found.kind[found.normal[:, 2] > 0.5].tolist() == [ChartKind.ROOF]
    assert upright.sum() == 4


def test_slightly_bent_walls_are_one_facet_and_corners_are_not() -> None:
    """A wall whose middle lies 4 cm off, in halves of 10 m; and one that turns by 6 degrees."""
    for bend, count in ((0.04, 1), (1.05, 2)):
        line = np.array([[0, 0], [10, -bend], [20, 0]])
        low, high = np.column_stack([line, np.zeros(3)]), np.column_stack([line, np.full(3, 9.0)])
        corners = np.array(
            [t for i in range(2) for t in ((low[i], low[i + 1], high[i + 1]), (low[i], high[i + 1], high[i]))]
        )
        found = extract_shell_facets(shell(corners), shapely.Polygon([*line, (20, 10), (0, 10)]))
        assert len(found) == count


def test_broken_models_are_refused_and_needles_left_out() -> None:
    broken = shell(box(0, 0, 0, 1, 1, 1))
    broken.vertices[3] = np.nan
    with pytest.raises(GeometryError, match="not numbers"):
        extract_shell_facets(broken, shapely.box(0, 0, 1, 1))
    needle = np.array([[[0, 0, 0], [5, 0, 0], [5, 0, 0.001]], [[0, 0, 0], [0, 0, 0], [1, 1, 1]]])
    assert len(extract_shell_facets(shell(needle), shapely.box(0, 0, 5, 1))) == 0
