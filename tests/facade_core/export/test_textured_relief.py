"""Elements of textured walls in depth: closed, bounded, equal to the flat wall from the front."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import shapely

from facade_core.core.types import Element
from facade_core.export.bodies.alignment import align_openings
from facade_core.export.bodies.element_relief import place_elements
from facade_core.export.bodies.settings import ELEMENT_DEPTHS
from facade_core.export.bodies.textured_relief import add_relief
from facade_core.export.models.textured_mesh import (
    TexturedMesh,
    build_nodes,
    mesh_y_up_frame,
    pack_charts_on_pages,
)
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.raycast import RayCaster

WINDOW, BALCONY = Element("window", 1.0, 2.0, 2.5, 4.0), Element("balcony", 4.0, 3.0, 7.0, 4.0)
ELEMENTS = [WINDOW, BALCONY, Element("shop", 3.0, 8.0, 7.0, 11.9), Element("door", 8.0, 9.5, 9.0, 12.0)]


def longest_wall(source: TexturedMesh) -> int:
    """The longest wall of building 0."""
    charts = source.charts
    walls = np.flatnonzero((charts.building == 0) & (charts.kind == ChartKind.WALL))
    return int(walls[np.argmax(charts.size[walls, 0])])


def chart_triangles(source: TexturedMesh, chart: int) -> np.ndarray:
    return source.mesh.vertices[source.mesh.triangles[source.mesh.chart_triangles(chart)]]


def count_edges(triangles: np.ndarray) -> Counter[tuple[tuple[float, ...], tuple[float, ...]]]:
    rings = [[tuple(p) for p in ring] for ring in triangles.round(3).tolist()]
    return Counter(edge for ring in rings for edge in zip(ring, ring[1:] + ring[:1], strict=True))


def outer_edges(triangles: np.ndarray) -> set[tuple[tuple[float, ...], tuple[float, ...]]]:
    """The edges that only one triangle has."""
    edges = count_edges(triangles)
    return {(a, b) for a, b in edges if (b, a) not in edges}


def test_openings_join_their_wall_without_gaps_and_its_outline_stays(coloured: TexturedMesh) -> None:
    wall = longest_wall(coloured)
    flat = chart_triangles(coloured, wall)
    deep = chart_triangles(add_relief(coloured, {wall: [e for e in ELEMENTS if e.label != "balcony"]}), wall)
    assert set(count_edges(deep).values()) == {1}, "no edge twice in one direction"
    assert outer_edges(deep) == outer_edges(flat), "each inner edge has a triangle on both sides"
    out = coloured.charts.normals()[wall]
    depth = ((deep - flat[0, 0]) @ out).min()
    assert depth == pytest.approx(ELEMENT_DEPTHS["window"], abs=1e-6)
    assert len(deep) - len(flat) <= 3 * 40


def test_a_balcony_is_a_box_open_to_its_wall(coloured: TexturedMesh) -> None:
    wall = longest_wall(coloured)
    flat = chart_triangles(coloured, wall)
    deep = chart_triangles(add_relief(coloured, {wall: [BALCONY]}), wall)
    out = coloured.charts.normals()[wall]
    height = (deep - flat[0, 0]) @ out
    assert height.max() == pytest.approx(0.9, abs=1e-6)
    body = deep[height.max(axis=1) > 1e-6]
    assert len(body) <= 40
    open_edges = {point for edge in outer_edges(body) for point in edge}
    assert np.abs((np.array(sorted(open_edges)) - flat[0, 0]) @ out).max() < 0.002, "open at the wall only"
    assert not (height[height.max(axis=1) < 1e-6].min() < -1e-6)


def test_cut_elements_and_those_without_room_stay_flat(coloured: TexturedMesh) -> None:
    wall = longest_wall(coloured)
    width, height = coloured.charts.size[wall]
    cut = [
        Element("window", width - 1, 2, width + 1, 4),  # beyond the end of the wall
        Element("window", 2, -1, 3, 1),  # above its top
        Element("window", 5, 3, 6, 5),
        Element("door", 5.5, 3, 6.5, 5.5),  # cuts the window
    ]
    placed = {(e.label, e.is_cut) for e in place_elements(shapely.box(0, 0, width, height), cut)}
    assert placed == {("window", True), ("door", False)}
    assert add_relief(coloured, {wall: cut[:2]}) is coloured
    only_door, both = (add_relief(coloured, {wall: e}) for e in (cut[3:], cut[2:]))
    np.testing.assert_array_equal(chart_triangles(only_door, wall), chart_triangles(both, wall))
    assert add_relief(coloured, {}) is coloured


def test_an_unlikely_element_stays_flat_unless_its_depth_is_measured(coloured: TexturedMesh) -> None:
    wall = longest_wall(coloured)
    doubted = replace(WINDOW, confidence=0.4)
    assert add_relief(coloured, {wall: [doubted]}) is coloured
    measured = replace(doubted, depth_m=-0.2, depth_source="parallax")
    assert add_relief(coloured, {wall: [measured]}) is not coloured


def test_an_element_is_no_deeper_than_the_building(coloured: TexturedMesh) -> None:
    wall = longest_wall(coloured)
    charts, mesh = coloured.charts, coloured.mesh
    out = charts.normals()[wall]
    other = int(
        np.flatnonzero(mesh.chart == next(c for c in np.unique(mesh.chart) if charts.kind[c] == ChartKind.ROOF))[0]
    )
    for gap, depth in ((0.1, -0.05), (0.04, 0.0)):
        corners = charts.points(wall, np.array([0.0, 9, 0]), np.array([0.0, 6, 12])) - gap * out
        vertices = np.concatenate([mesh.vertices, corners])
        triangles = mesh.triangles.copy()
        triangles[other] = len(mesh.vertices) + np.arange(3)
        near = replace(
            coloured,
            mesh=replace(
                mesh,
                vertices=vertices,
                triangles=triangles,
                vertex_chart=np.append(mesh.vertex_chart, [mesh.chart[other]] * 3).astype(np.int32),
            ),
        )
        deep = chart_triangles(add_relief(near, {wall: [WINDOW]}), wall)
        assert ((deep - deep[0, 0]) @ out).min() == pytest.approx(depth, abs=1e-6)


def test_a_balcony_stays_flat_before_another_building(coloured: TexturedMesh) -> None:
    wall = longest_wall(coloured)
    charts, mesh = coloured.charts, coloured.mesh
    shown = charts.points(wall, np.array([5.0, 6, 5]), np.array([3.2, 3.2, 3.8]))
    other = int(np.flatnonzero(charts.building[mesh.chart] == 1)[0])
    moved = int(mesh.chart[other])
    for metres, is_flat in ((0.5, True), (2.0, False)):
        # a chart of the other building, moved before the wall
        corners = shown + metres * charts.normals()[wall]
        origin = charts.origin.copy()
        origin[moved] = corners[0]
        triangles = mesh.triangles.copy()
        triangles[other] = len(mesh.vertices) + np.arange(3)
        near = replace(
            coloured,
            charts=replace(charts, origin=origin),
            mesh=replace(
                mesh,
                vertices=np.concatenate([mesh.vertices, corners]),
                triangles=triangles,
                vertex_chart=np.append(mesh.vertex_chart, [moved] * 3).astype(np.int32),
            ),
        )
        assert (add_relief(near, {wall: [BALCONY]}) is near) == is_flat


def test_elements_in_any_order_give_the_same_mesh(coloured: TexturedMesh) -> None:
    wall = longest_wall(coloured)
    one, other = (add_relief(coloured, {wall: elements}) for elements in (ELEMENTS, ELEMENTS[::-1]))
    for a, b in zip(vars(one.mesh).values(), vars(other.mesh).values(), strict=False):
        if isinstance(a, np.ndarray):
            np.testing.assert_array_equal(a, b)
    assert one.frames is not None
    assert other.frames is not None
    for a, b in zip(one.frames, other.frames, strict=True):
        np.testing.assert_array_equal(a, b)


def test_from_the_front_each_place_shows_the_texel_of_the_flat_wall(coloured: TexturedMesh) -> None:
    wall = longest_wall(coloured)
    deep = add_relief(coloured, {wall: ELEMENTS})
    charts, out = coloured.charts, coloured.charts.normals()[wall]
    width, height = charts.size[wall]
    x, y = (side.ravel() for side in np.meshgrid(np.arange(0.203, width, 0.37), np.arange(0.207, height, 0.31)))
    start = charts.points(wall, x, y) + 1.5 * out
    depth, chart = RayCaster(deep.mesh).cast(start, np.broadcast_to(-out, start.shape))
    assert (chart == wall).all(), "no hole"
    assert depth.min() == pytest.approx(0.6, abs=1e-3)
    assert depth.max() == pytest.approx(1.65, abs=1e-3)
    # the nearest triangle that a ray meets shows the ray's own place
    mesh = deep.mesh
    own = mesh.chart_triangles(wall)
    points, shown = mesh.vertices[mesh.triangles[own]], deep.coordinates[mesh.triangles[own]]
    facing = np.einsum("ij,j->i", deep.normals[mesh.triangles[own][:, 0]], out) > 0.5
    real = charts.coordinates(np.full(points[facing].size // 3, wall), points[facing].reshape(-1, 3))
    np.testing.assert_allclose(shown[facing].reshape(-1, 2), real, atol=1e-6)


def test_nodes_have_unit_frames_and_texture_coordinates_on_their_page(coloured: TexturedMesh) -> None:
    wall = longest_wall(coloured)
    lit = replace(coloured, maps=lambda chart: pytest.fail("no map is drawn"))
    deep = add_relief(lit, {wall: ELEMENTS})
    drawn = pack_charts_on_pages(deep, deep.select_charts(np.array([0])))
    (node,), _ = build_nodes([drawn], {0: "a"}, mesh_y_up_frame(coloured.mesh))
    for primitive in node.primitives:
        assert primitive.tangent is not None
        along, hand = primitive.tangent[:, :3], primitive.tangent[:, 3]
        np.testing.assert_allclose(np.linalg.norm(primitive.normal, axis=1), 1, atol=1e-6)
        np.testing.assert_allclose(np.linalg.norm(along, axis=1), 1, atol=1e-6)
        np.testing.assert_allclose((along * primitive.normal).sum(axis=1), 0, atol=1e-6)
        assert set(hand.tolist()) == {1.0, -1.0}, "reveals are mirrored"
        assert (primitive.uv >= 0).all()
        assert (primitive.uv <= 1).all()


def paint(source: TexturedMesh, wall: int, boxes: Sequence[tuple[float, float, float, float, int]]) -> TexturedMesh:
    """The mesh with a light grey wall on which boxes in metres have a grey level each."""
    columns, rows = source.texels[wall].tolist()
    drawn = np.full((rows, columns, 3), 180, np.uint8)
    across, down = source.texels[wall] / source.extent[wall]
    for x0, y0, x1, y1, grey in boxes:
        drawn[round(y0 * down) : round(y1 * down), round(x0 * across) : round(x1 * across)] = grey
    return replace(source, raster=lambda chart: drawn if chart == wall else source.raster(chart))


def cast_at_wall(deep: TexturedMesh, wall: int, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Metres before the wall at which rays from the front meet the mesh."""
    out = deep.charts.normals()[wall]
    start = deep.charts.points(wall, x, y) + 1.5 * out
    depth, _ = RayCaster(deep.mesh).cast(start, np.broadcast_to(-out, start.shape))
    return 1.5 - depth


def test_a_railing_is_seen_through_where_its_columns_differ(coloured: TexturedMesh) -> None:
    wall = longest_wall(coloured)
    above = [(4.5, 2.0, 5.2, 3.0, 60), (5.8, 2.0, 6.5, 3.0, 60)]
    behind = [(4.5, 3.0, 5.2, 3.9, 40), (5.8, 3.0, 6.5, 3.9, 40)]
    x = np.arange(4.01, 7, 0.005)
    rows = np.full(len(x), 3.4)
    through = add_relief(paint(coloured, wall, [*above, *behind]), {wall: [BALCONY]})
    depth = cast_at_wall(through, wall, x, rows)
    assert {0, 90} == set(np.rint(100 * depth).astype(int).tolist())
    assert 0.1 < (depth > 0.5).mean() < 0.35, "bars are seldom in the way"
    for y in (3.03, 3.95):  # handrail and floor
        np.testing.assert_allclose(cast_at_wall(through, wall, x, np.full(len(x), y)), 0.9, atol=1e-3)
    parapet = add_relief(paint(coloured, wall, above), {wall: [BALCONY]})
    np.testing.assert_allclose(cast_at_wall(parapet, wall, x, rows), 0.9, atol=1e-3)


def test_a_light_band_of_the_picture_stands_out_as_a_ledge(coloured: TexturedMesh) -> None:
    wall = longest_wall(coloured)
    width = float(coloured.charts.size[wall, 0])
    window = Element("window", 1.0, 1.0, 2.0, 1.6)
    for grey, outward in ((250, 0.08), (180, 0.0)):
        deep = add_relief(paint(coloured, wall, [(0, 2.0, width, 2.4, grey)]), {wall: [window]})
        x = np.arange(0.3, width - 0.3, 0.1)
        np.testing.assert_allclose(cast_at_wall(deep, wall, x, np.full(len(x), 2.2)), outward, atol=2e-3)


def test_coupled_windows_share_the_pier_between_them() -> None:
    picture = np.full((100, 100, 3), 120, np.uint8)
    picture[40:80, 20:40] = picture[40:80, 42:62] = 30  # a pier of 0.1 m
    pair = [Element("window", 1.05, 2.0, 1.98, 4.0), Element("window", 2.12, 2.0, 3.05, 4.0)]
    left, right = align_openings(picture, np.array([20.0, 20.0]), pair)
    assert left.x1 <= right.x0
    assert align_openings(picture, np.array([20.0, 20.0]), pair[::-1]) == [right, left], "in any order"


def test_openings_end_at_the_outermost_edge_of_their_picture() -> None:
    density = np.array([20.0, 20.0])
    picture = np.full((100, 100, 3), 120, np.uint8)
    picture[40:80, 30:60] = 230  # the frame
    picture[42:78, 32:58] = 30  # the pane
    parsed = Element("window", 1.6, 2.1, 2.9, 4.05)
    (found,) = align_openings(picture, density, [parsed])
    assert (found.x0, found.y0, found.x1, found.y1) == (1.5, 2.0, 3.0, 4.0)
    plain = np.full((100, 100, 3), 120, np.uint8)
    assert align_openings(plain, density, [parsed]) == [parsed], "nothing to align with"
    far = replace(parsed, x0=1.8)
    assert align_openings(picture, density, [far])[0].x0 >= 1.63, "a side moves by 0.17 m at most"
    narrow = replace(parsed, x0=1.52, x1=1.58)
    (found,) = align_openings(picture, density, [narrow])
    assert found.x0 < found.x1, "sides stay apart"
    balcony = replace(parsed, label="balcony")
    assert align_openings(picture, density, [balcony]) == [balcony]
