"""Faces of CityJSON: outlines of charts, openings, indices, semantics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from facade_core.export.buildings import building_faces, ground_faces
from facade_core.export.cityjson import Face, Pool, multi_surface, welded
from facade_core.export.models import Drawn, Textured, layout_of
from facade_core.export.openings import cut_openings, outlines
from facade_core.geometry import ROOF, WALL, WINDOW
from facade_core.grouping import grouped
from facade_core.types import Element


@pytest.fixture(scope="module")
def drawn(coloured: Textured) -> Drawn:
    return layout_of(coloured, coloured.chosen(np.array([0, 1, -1])))


def newell(ring: np.ndarray) -> np.ndarray:
    return np.cross(ring - ring[0], np.roll(ring, -1, axis=0) - ring[0]).sum(axis=0) / 2


def test_triangles_become_the_outline_they_make_up() -> None:
    corners = [[0, 0], [4, 0], [4, 3], [0, 3], [1, 1], [2, 1], [2, 2], [1, 2]]
    pairs = [(0, 1, 5), (0, 5, 4), (1, 2, 6), (1, 6, 5), (2, 3, 7), (2, 7, 6), (3, 0, 4), (3, 4, 7)]
    (outline,) = outlines(np.array([[corners[i] for i in t] for t in pairs], float))
    assert outline.area == pytest.approx(11)
    assert len(outline.interiors) == 1
    assert not outline.exterior.is_ccw, "y counts down"
    overlapping = np.array([[[0, 0], [2, 0], [0, 2]], [[0, 0], [2, 0], [0, 2]]], float)
    assert sum(part.area for part in outlines(overlapping)) == pytest.approx(4), "no triangle is lost"


def test_openings_are_free_of_each_other_and_leave_the_rest_of_the_wall() -> None:
    wall = shapely.box(0, 0, 10, 6)
    elements = [
        Element("window", 1, 1, 2, 2.5),
        Element("window", 2, 1, 3, 2.5),  # touches the first
        Element("window", 5, 3, 7, 5.5),
        Element("door", 6, 4, 7, 6.4),  # overlaps a window, reaches below the wall
        Element("window", 9.99, 1, 12, 2),  # hardly on the wall
        Element("balcony", 1, 2.5, 3, 3),
    ]
    walls, openings = cut_openings(wall, elements)
    assert sorted(e.label for e, _ in openings) == ["door", "window", "window", "window"]
    total = shapely.union_all([*walls, *(opening for _, opening in openings)])
    assert total.area == pytest.approx(60)
    assert sum(p.area for p in [*walls, *(o for _, o in openings)]) == pytest.approx(60), "nothing overlaps"
    assert next(o.area for e, o in openings if e.label == "door") == pytest.approx(2.0)
    assert all(p.is_valid for p in walls)
    assert len(walls[0].interiors) >= 1


def test_faces_of_a_building_look_outwards_and_know_their_texture(drawn: Drawn, coloured: Textured) -> None:
    triangles = grouped(coloured.charts.building[coloured.mesh.chart])[0]
    wall = next(c for c in np.flatnonzero(coloured.charts.building == 0) if coloured.charts.kind[c] == WALL)
    window = Element("window", 1.0, 2.0, 2.5, 4.0)
    faces, surfaces = building_faces(drawn, triangles, {wall: "a-0"}, {wall: [window]})
    centre = coloured.mesh.vertices[coloured.mesh.triangles[triangles]].mean(axis=(0, 1))
    area = 0.0
    for face in faces:
        normal = sum(newell(ring) for ring in face.rings)
        assert normal @ (face.rings[0].mean(axis=0) - centre) > 0
        area += float(np.linalg.norm(normal))
        assert (face.page is None) == (surfaces[face.semantic]["type"] == "GroundSurface")
        for place in face.uv:
            assert (place >= 0).all()
            assert (place <= 1).all()
    assert area == pytest.approx(2 * 20 * 10 + 2 * (20 + 10) * 12, rel=1e-6), "the body is closed, holes are filled"
    opening = next(f for f in faces if surfaces[f.semantic]["type"] == "Window")
    assert np.linalg.norm(newell(opening.rings[0])) == pytest.approx(3.0)
    assert surfaces[surfaces[opening.semantic]["parent"]] == {"type": "WallSurface", "facade": "a-0"}
    whole = next(f for f in faces if len(f.rings) == 2)
    assert newell(whole.rings[0]) @ newell(whole.rings[1]) < 0, "holes run the other way"


def test_panes_that_are_drawn_on_an_assumed_roof_are_no_openings(drawn: Drawn, coloured: Textured) -> None:
    triangles = grouped(coloured.charts.building[coloured.mesh.chart])[0]
    roof = np.flatnonzero((coloured.charts.building == 0) & (coloured.charts.kind == ROOF))[:1]
    kind = coloured.charts.kind.copy()
    kind[roof] = WINDOW
    with_pane = replace(drawn, source=replace(drawn.source, charts=replace(drawn.source.charts, kind=kind)))
    for assumed, named in ((False, "Window"), (True, "RoofSurface")):
        faces, surfaces = building_faces(with_pane, triangles, {}, {}, assumed=assumed)
        types = {surfaces[face.semantic]["type"] for face in faces}
        assert (named in types, "Window" in types) == (True, not assumed)


def test_a_geometry_indexes_its_tables(drawn: Drawn, coloured: Textured) -> None:
    triangles = grouped(coloured.charts.building[coloured.mesh.chart])
    pool = Pool(np.array([386000.0, 6671900.0, 0.0]))
    faces, surfaces = building_faces(drawn, triangles[1], {}, {})
    geometry = multi_surface(faces, surfaces, pool, "2")
    terrain = multi_surface(ground_faces(drawn, triangles[-1]), (), pool, "2", "CompositeSurface")
    tables = pool.tables(["p.jpg"] * 9)
    assert "semantics" not in terrain
    assert len(geometry["semantics"]["values"]) == len(geometry["boundaries"]) == 6
    assert {tuple(v) for v in tables["vertices"]} == {
        tuple(tables["vertices"][i]) for g in (geometry, terrain) for s in g["boundaries"] for r in s for i in r
    }
    for part in (geometry, terrain):
        for surface, texture in zip(part["boundaries"], part["texture"]["streetloom"]["values"], strict=True):
            for ring, places in zip(surface, texture, strict=True):
                assert len(set(ring)) == len(ring) >= 3
                assert places == [None] or len(places) == len(ring) + 1
    low, high = np.split(np.array(pool.extent()), 2)
    np.testing.assert_allclose(high[2] - low[2], 9.0)


def test_rings_meet_no_corner_twice_and_have_area() -> None:
    pool = Pool(np.zeros(3))
    spike = np.array([[0, 0, 0], [4, 0, 0], [4, 0, 4], [4, 0, 4.0002], [2, 0, 4], [2, 0, 6], [2, 0, 4], [0, 0, 4]])
    corners, _ = pool.ring(spike, None)
    assert len(corners) == len(set(corners)) == 5
    line = np.array([[0, 0, 0], [4, 0, 0], [8, 0, 0.0001]])
    assert pool.ring(line, None) == ([], [])
    geometry = multi_surface([Face((line,), 0), Face((spike,), 1)], [{"type": "Window"}, {"type": "Door"}], pool, "2")
    assert geometry["semantics"] == {"surfaces": [{"type": "Door"}], "values": [0]}
    assert "texture" not in geometry


def test_corners_that_pass_by_millimetres_are_one() -> None:
    # the hip of a roof meets the eaves twice, 4 mm apart, as the faces on its two sides have it
    one = np.array([[0.0, 0, 0], [10, 0, 0], [10.004, 0, 0], [5, 5, 3]])
    other = np.array([[10.004, 0, 0], [10, 8, 0], [5, 5, 3]])
    hole = np.array([[4.0, 1, 0.6], [4, 2, 1.2], [5, 2, 1.2]])
    left, right = welded([Face((one, hole), 0, page=None), Face((other,), 1)])
    assert np.array_equal(left.rings[0][1], left.rings[0][2])
    assert np.array_equal(left.rings[0][1], right.rings[0][0])
    assert np.array_equal(left.rings[1], hole)
    assert (left.semantic, right.semantic) == (0, 1)
    corners, _ = Pool(np.zeros(3)).ring(left.rings[0], None)
    assert len(corners) == 3
    assert welded([]) == []
