"""Frames of charts, the mesh's columns and cutting on the grid."""

from __future__ import annotations

import numpy as np
import pytest

from facade_core.geometry.charts import CORNER_SHARES, ChartBuilder, ChartKind, Charts, Mesh, chart_axes_right_down
from facade_core.geometry.cutting import cut_triangles_on_grid


def test_frames_are_right_handed_level_and_point_down() -> None:
    rng = np.random.default_rng(3)
    normal = np.concatenate([rng.normal(size=(50, 3)), [[0, 0, 1], [0, 0, -1], [0.01, 0.02, 1], [0, -1, 0]]])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    u, v = chart_axes_right_down(normal)
    np.testing.assert_allclose(np.cross(v, u), normal, atol=1e-12)
    tilted = np.hypot(*normal[:, :2].T) > 0.04
    np.testing.assert_allclose(u[tilted, 2], 0, atol=1e-12)
    assert (v[tilted, 2] < 0).all()
    assert (u[-4:, 0] > 0.99).all()
    np.testing.assert_allclose([u[-1], v[-1]], [[1, 0, 0], [0, 0, -1]])


def test_pieces_split_shared_vertices_and_start_at_zero() -> None:
    vertices = np.array([[0, 0, 5], [4, 0, 5], [4, 3, 5], [0, 3, 5], [8, 0, 9]], np.float64)
    triangles = np.array([[0, 1, 2], [0, 2, 3], [1, 4, 2]])
    second = np.cross(vertices[4] - vertices[1], vertices[2] - vertices[1])
    normal = np.array([[0, 0, 1], second / np.linalg.norm(second)])
    pieces = ChartBuilder()
    for _ in range(2):
        pieces.add_surfaces(
            np.array([ChartKind.ROOF, ChartKind.ROOF]),
            np.arange(2),
            0,
            *chart_axes_right_down(normal),
            vertices,
            triangles,
            np.array([0, 0, 1]),
        )
    charts, mesh = pieces.build()
    assert charts.surface.tolist() == [0, 1, 2, 3]
    assert mesh.vertex_chart.tolist() == [0] * 4 + [1] * 3 + [2] * 4 + [3] * 3
    np.testing.assert_array_equal(mesh.vertices[mesh.triangles], np.tile(vertices[triangles], (2, 1, 1)))
    assert (mesh.vertex_chart[mesh.triangles] == mesh.chart[:, None]).all()
    xy = mesh.chart_coordinates(charts)
    for c in range(4):
        np.testing.assert_allclose(xy[mesh.vertex_chart == c].min(axis=0), 0, atol=1e-9)
        np.testing.assert_allclose(xy[mesh.vertex_chart == c].max(axis=0), charts.size[c], atol=1e-9)
    assert charts.size[0].tolist() == [4, 3]
    assert (mesh.texture == -1).all()


def test_points_of_charts_and_their_coordinates() -> None:
    rng = np.random.default_rng(4)
    normal = rng.normal(size=(5, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    zeros = np.zeros(5, np.int32)
    charts = Charts(
        zeros, zeros, zeros, rng.normal(size=(5, 3)) * 1e5, *chart_axes_right_down(normal), rng.uniform(1, 20, (5, 2))
    )
    np.testing.assert_allclose(charts.normals(), normal, atol=1e-12)
    with pytest.raises(ValueError, match="read-only"):
        charts.normals()[0] = 0
    chart, place = rng.integers(0, 5, 40), rng.uniform(-30, 30, (40, 2))
    points = charts.points(chart, *place.T)
    np.testing.assert_allclose(charts.coordinates(chart, points), place, atol=1e-9)
    np.testing.assert_array_equal(charts.points(int(chart[7]), *place[7]), points[7])
    raster = charts.points(2, np.arange(4.0), np.arange(3.0)[:, None])
    np.testing.assert_array_equal(raster[1, 3], charts.points(2, np.array(3.0), np.array(1.0)))
    corners = charts.points_at_shares(np.array([3, 1]), CORNER_SHARES)
    np.testing.assert_allclose(charts.coordinates(np.full(4, 1), corners[1]), CORNER_SHARES * charts.size[1], atol=1e-9)


def test_a_mesh_may_have_no_pictures() -> None:
    mesh = Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]]), np.zeros(1, np.int32), np.zeros(3, np.int32))
    assert mesh.texture.tolist() == [-1]
    assert mesh.uv.shape == (1, 3, 2)


def test_cut_triangles_cover_the_same_area_cell_by_cell_and_carry_their_texture() -> None:
    rng = np.random.default_rng(5)
    plane = np.array([[0.9, 0.1, 0.3], [-0.2, 0.95, 0.4]])
    flat = np.concatenate([rng.uniform(-70, 90, (40, 2)), [[32.0, 0.0], [64.0, 10.0]]])
    vertices = flat @ plane
    vertices[-2:, 0] = [32.0, 64.0]
    triangles = np.array([rng.choice(len(flat), 3, replace=False) for _ in range(60)])
    matrix = rng.normal(size=(3, 2))
    uv = (vertices @ matrix)[triangles]
    points, cut, cut_uv, source, cell = cut_triangles_on_grid(vertices, triangles, uv, 32.0)

    def area(p: np.ndarray, t: np.ndarray) -> np.ndarray:
        a, b, c = (p[t[:, k]] for k in range(3))
        return np.cross(b - a, c - a) / 2

    np.testing.assert_array_equal(points[: len(vertices)], vertices)
    whole = np.zeros((60, 3))
    np.add.at(whole, source, area(points, cut))
    np.testing.assert_allclose(whole, area(vertices, triangles), atol=1e-6)
    np.testing.assert_allclose(cut_uv, (points @ matrix)[cut], atol=1e-6)
    for c in range(cell.max() + 1):
        corners = points[cut[cell == c]].reshape(-1, 3)
        assert (np.ptp(corners, axis=0) <= 32 + 1e-5).all()
