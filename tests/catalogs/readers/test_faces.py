"""Faces into shells: cut in their own planes, turning as they did, with holes and texture coordinates."""

from __future__ import annotations

import numpy as np
import pytest

from catalogs.readers.faces import PlanarFace, triangulate_faces
from facade_core.core.types import SEMANTICS, BuildingShell

WALL = np.array([[0, 0, 0], [4, 0, 0], [4, 0, 3], [0, 0, 3]], np.float64)
HOLE = np.array([[1, 0, 1], [1, 0, 2], [2, 0, 2], [2, 0, 1]], np.float64)
FAR = np.array([90_000.0, 436_000.0, 10.0])


def turned(angle: float, axis: str = "z") -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    matrix = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    return matrix if axis == "z" else np.roll(np.roll(matrix, 1, 0), 1, 1)


def areas(shell: BuildingShell) -> np.ndarray:
    """Twice the area vectors of the triangles, halved: (t, 3)."""
    a, b, c = (shell.vertices[shell.triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a) / 2


def made(*faces: PlanarFace, scale: tuple[float, float] = (1.0, 1.0)) -> BuildingShell:
    shell = triangulate_faces(faces, scale)
    assert shell is not None
    return shell


@pytest.mark.parametrize("rotation", [turned(a, axis) for axis in "zx" for a in (0.0, 0.4, 1.6, 3.0)])
@pytest.mark.parametrize("step", [1, -1])
def test_a_wall_with_a_window_keeps_area_and_direction(rotation: np.ndarray, step: int) -> None:
    rings = [(ring @ rotation.T + FAR)[::step] for ring in (WALL, HOLE)]
    shell = made(PlanarFace(rings, "wall"))
    expected = rotation @ np.array([0.0, -11.0, 0.0]) * step
    np.testing.assert_allclose(areas(shell).sum(axis=0), expected, atol=1e-6)
    assert (areas(shell) @ expected > 0).all(), "no triangle is turned over"
    assert len(shell.vertices) == 8
    assert {SEMANTICS[k] for k in shell.semantic} == {"wall"}


def test_triangles_and_polygons_of_one_building_stay_apart() -> None:
    roof = np.array([[0, 0, 3], [4, 0, 3], [2, 2, 5.0]])
    bent = np.array([[0, 0, 0], [6, 0, 0], [6, 2, 0], [2, 2, 0], [2, 6, 0], [0, 6, 0.0]])
    shell = made(PlanarFace([WALL], "wall"), PlanarFace([roof], "roof"), PlanarFace([bent[::-1]], "ground"))
    sizes = np.linalg.norm(areas(shell), axis=1)
    by_kind = {kind: sizes[shell.semantic == SEMANTICS.index(kind)].sum() for kind in ("wall", "roof", "ground")}
    assert by_kind == pytest.approx({"wall": 12.0, "roof": 4 * np.sqrt(8) / 2, "ground": 20.0})
    assert len(shell.vertices) == 4 + 1 + 5, "corners of neighbours are shared"
    assert (shell.texture == -1).all()
    assert not shell.uv.any()


def test_texture_coordinates_stay_with_their_corners() -> None:
    """u runs with x and v with z, so they are told from the corners again."""
    uv = [ring[:, [0, 2]] / (4.0, 3.0) for ring in (WALL, HOLE)]
    plain = PlanarFace([WALL + np.array([0, 5, 0])], "wall")
    shell = made(plain, PlanarFace([WALL, HOLE], "wall", 2, uv), PlanarFace([WALL + np.array([0, 9, 0])], "wall", 1))
    corners = shell.vertices[shell.triangles]
    textured = shell.texture == 2
    assert textured.sum() == 8
    np.testing.assert_allclose(shell.uv[textured], corners[textured][..., [0, 2]] / (4.0, 3.0), atol=1e-6)
    assert (shell.texture[~textured] == -1).all(), "a picture without coordinates is none"
    assert not shell.uv[~textured].any()


def test_faces_in_degrees_are_cut_in_metres() -> None:
    """A roof of 20 x 10 m whose corners are 0.0002 degrees apart is as good as any."""
    scale = (68_000.0, 111_000.0)
    rings = [(ring[:, [0, 2, 1]] * 5 / (*scale, 1.0)) + (4.4, 52.0, 0.0) for ring in (WALL, HOLE)]
    shell = made(PlanarFace(rings), scale=scale)
    metric = areas(
        BuildingShell(shell.vertices * (*scale, 1.0), shell.triangles, shell.semantic, shell.texture, shell.uv)
    )
    np.testing.assert_allclose(metric.sum(axis=0), [0, 0, 275.0], rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize(
    "rings",
    [
        [],
        [WALL[:2]],
        [np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0.0]])],
        [np.array([[0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0.0]])],
        [WALL[[0, 0, 0, 0]]],
        [np.where(WALL == 3, np.nan, WALL)],
        [np.where(WALL == 3, np.inf, WALL)],
        [WALL[:2], HOLE],
    ],
    ids=["no ring", "two corners", "in a line", "bow tie", "a point", "NaN", "infinite", "outer ring broken"],
)
def test_a_face_without_area_is_left_out(rings: list[np.ndarray]) -> None:
    assert triangulate_faces([PlanarFace(rings)]) is None
    shell = made(
        PlanarFace(rings, "wall", 0, [np.full((len(ring), 2), 0.5) for ring in rings]), PlanarFace([WALL], "roof")
    )
    assert len(shell.triangles) == 2
    assert {SEMANTICS[k] for k in shell.semantic} == {"roof"}


def test_repeated_corners_and_broken_holes_do_no_harm() -> None:
    closed = np.concatenate([WALL, WALL[:1]])[[0, 0, 1, 2, 3, 4]]
    shell = made(PlanarFace([closed, HOLE[:2]]))
    assert np.linalg.norm(areas(shell).sum(axis=0)) == pytest.approx(12.0)
    assert triangulate_faces([]) is None


def test_a_face_that_is_not_quite_flat_keeps_its_corners() -> None:
    wall = WALL + np.array([[0, 0, 0], [0, 0.05, 0], [0, 0, 0], [0, 0.05, 0]])
    shell = made(PlanarFace([wall]))
    assert {tuple(v) for v in shell.vertices} == {tuple(v) for v in wall}
    assert np.linalg.norm(areas(shell), axis=1).sum() == pytest.approx(12.0, abs=0.01)
