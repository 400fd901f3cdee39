"""Surfaces, charts, packing, projection and viewpoints on small truths."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from benchmarks.papers.translator.projection import project_points_to_panorama
from facade_core.core.errors import GeometryError
from facade_core.core.types import Building, Street
from facade_core.geometry.block_surfaces import build_block_surfaces
from facade_core.geometry.chart_packing import pack_charts
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.equirectangular import panorama_rays
from facade_core.geometry.ground.terrain import build_terrain
from facade_core.geometry.streets import place_viewpoints

BOX = Building("a", shapely.box(0, 0, 20, 10), 12.0, "height")
STREET = Street("s", None, shapely.LineString([(-30, -8), (50, -8)]))


def test_a_box_has_four_walls_a_roof_and_ground() -> None:
    charts, mesh, _ = build_block_surfaces(
        [BOX], [STREET], terrain=build_terrain([], None), ground_margin=20, largest=100
    )
    walls = charts.kind == ChartKind.WALL
    assert walls.sum() == 4
    assert (charts.kind == ChartKind.ROOF).sum() == 1
    assert sorted(map(tuple, charts.size[walls].tolist())) == [(10, 12), (10, 12), (20, 12), (20, 12)]
    inward = shapely.Point(10, 5)
    for normal, origin, along, size in zip(
        charts.normals()[walls], charts.origin[walls], charts.axis_u[walls], charts.size[walls], strict=True
    ):
        middle = origin + along * size[0] / 2
        outside, inside = (shapely.Point(*(middle + s * normal)[:2]) for s in (1, -1))
        assert outside.distance(inward) > inside.distance(inward)
    # every triangle faces as its chart does
    corners = mesh.vertices[mesh.triangles]
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("ij,ij->i", facing, charts.normals()[mesh.chart]) > 0).all()


def test_ground_is_cut_on_the_world_grid_and_leaves_out_the_building() -> None:
    charts, mesh, _ = build_block_surfaces(
        [BOX], [STREET], terrain=build_terrain([], None), ground_margin=20, largest=100
    )
    ground = charts.kind == ChartKind.GROUND
    assert charts.size[ground].max() <= 32 + 1e-9
    assert len(set(charts.surface[ground])) == 1
    triangles = mesh.vertices[mesh.triangles][charts.kind[mesh.chart] == ChartKind.GROUND][..., :2]
    area = sum(shapely.Polygon(triangle).area for triangle in triangles)
    near, built = STREET.line.buffer(20, cap_style="square"), BOX.footprint
    assert near.difference(built).area <= area <= near.union(built.buffer(6.1)).difference(built).area + 1e-6


def test_long_walls_are_cut_and_keep_their_surface() -> None:
    long = Building("l", shapely.box(5, 0, 155, 10), 12.0, "height")
    charts, _, _ = build_block_surfaces([long], [], terrain=build_terrain([], None), ground_margin=20, largest=100)
    south = (charts.kind == ChartKind.WALL) & (charts.normals()[:, 1] < -0.9)
    assert charts.size[south, 0].max() <= 32
    assert charts.size[south, 0].sum() == pytest.approx(150)
    assert len(set(charts.surface[south])) == 1


def test_chart_coordinates_undo_the_frame() -> None:
    charts, mesh, _ = build_block_surfaces(
        [BOX], [STREET], terrain=build_terrain([], None), ground_margin=20, largest=100
    )
    xy = mesh.chart_coordinates(charts)
    own = mesh.vertex_chart
    back = charts.origin[own] + xy[:, :1] * charts.axis_u[own] + xy[:, 1:] * charts.axis_v[own]
    np.testing.assert_allclose(back, mesh.vertices, atol=1e-9)
    assert (xy >= -1e-9).all()
    assert (xy <= charts.size[own] + 1e-9).all()


def test_nothing_to_texture_is_an_error() -> None:
    with pytest.raises(GeometryError, match="neither buildings nor streets"):
        build_block_surfaces([], [], terrain=build_terrain([], None), ground_margin=1, largest=1)


def test_packing_keeps_charts_apart_and_chunks_to_one_owner() -> None:
    rng = np.random.default_rng(1)
    owner = np.repeat(np.arange(60), 7)
    texels = rng.integers(5, 500, (len(owner), 2))
    texels[rng.random(len(owner)) < 0.4] //= 12
    texels = np.maximum(texels, 1)
    placed = pack_charts(texels, 1.0, owner, page=1024, chunk=128, gutter=2)
    taken = np.zeros((placed.pages, 1024, 1024), bool)
    owners: dict[tuple, int] = {}
    for chart in range(len(owner)):
        y, x = placed.y[chart] - 2, placed.x[chart] - 2
        box = taken[placed.page[chart], y : y + texels[chart, 1] + 4, x : x + texels[chart, 0] + 4]
        assert box.shape == (texels[chart, 1] + 4, texels[chart, 0] + 4)
        assert not box.any()
        box[:] = True
        for cell in map(tuple, placed.chunks(chart, 128, 2).tolist()):
            assert owners.setdefault(cell, int(owner[chart])) == owner[chart]
    assert taken.mean() > 0.35


def test_ownerless_charts_never_share_a_chunk() -> None:
    placed = pack_charts(np.full((9, 2), 10), 1.0, np.full(9, -1), page=512, chunk=128, gutter=2)
    cells = [tuple(placed.chunks(c, 128, 2)[0]) for c in range(9)]
    assert len(set(cells)) == 9


def test_a_chart_larger_than_a_page_is_refused() -> None:
    with pytest.raises(GeometryError, match="chart 1"):
        pack_charts(np.array([[10, 10], [600, 10]]), 1.0, np.zeros(2), page=512, chunk=128, gutter=2)


def test_projection_undoes_directions() -> None:
    forward = np.array([0.6, 0.8])
    rays = panorama_rays(forward, 64)
    position = np.array([5.0, -3.0, 2.5])
    pixels, distance = project_points_to_panorama(position + 7 * rays, position, forward, 64)
    rows, columns = np.mgrid[0:32, 0:64]
    np.testing.assert_allclose(pixels, np.stack([columns + 0.5, rows + 0.5], axis=-1), atol=1e-6)
    np.testing.assert_allclose(distance, 7)


def test_panorama_centre_looks_along_the_street_and_right_is_right() -> None:
    ahead, _ = project_points_to_panorama(
        np.array([[0.0, 10, 0], [10, 0, 0], [0, 0, 10]]), np.zeros(3), np.array([0.0, 1.0]), 400
    )
    np.testing.assert_allclose(ahead[0], [200, 100])
    np.testing.assert_allclose(ahead[1], [300, 100])
    assert ahead[2, 1] == pytest.approx(0)


def test_viewpoints_every_five_metres_outside_buildings() -> None:
    line = shapely.LineString([(-30, 5), (50, 5)])
    positions, forward = place_viewpoints(line, spacing=5.0, height=2.5, obstacles=[BOX.footprint])
    assert (positions[:, 2] == 2.5).all()
    np.testing.assert_allclose(forward, np.tile([1.0, 0.0], (len(forward), 1)))
    assert not any(BOX.footprint.buffer(0.29).contains(shapely.Point(*p[:2])) for p in positions)
    assert set(np.round(np.diff(positions[:, 0]), 6)) == {5.0, 25.0}
