"""Faces of CityJSON: outlines of charts, openings, indices, semantics."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import shapely

from facade_core.core.grouping import group_rows
from facade_core.core.types import Element
from facade_core.export.bodies.balconies import extend_windows_behind_railings
from facade_core.export.bodies.building_models import build_building_model_parts, ground_faces
from facade_core.export.bodies.model_face import ModelFace
from facade_core.export.bodies.openings import chart_outlines, place_openings
from facade_core.export.city_models.cityjson import VertexPool, build_geometry
from facade_core.export.models.textured_mesh import PackedCharts, TexturedMesh, pack_charts_on_pages
from facade_core.geometry.charts import ChartKind


@pytest.fixture(scope="module")
def drawn(coloured: TexturedMesh) -> PackedCharts:
    return pack_charts_on_pages(coloured, coloured.select_charts(np.array([0, 1, -1])))


ORIGIN = np.array([386000.0, 6671900.0, 0.0])


def watertight(faces: Sequence[ModelFace]) -> bool:
    """Whether each edge is there twice, in opposite directions."""
    rings = [[tuple(p) for p in ring.round(3).tolist()] for face in faces for ring in face.rings]
    edges = Counter(edge for ring in rings for edge in zip(ring, ring[1:] + ring[:1], strict=True))
    return set(edges.values()) == {1} and all((b, a) in edges for a, b in edges)


def volume_under(face: ModelFace) -> float:
    """Of a body's face, its part of the volume."""
    return sum(float(newell(ring) @ (face.rings[0][0] - ORIGIN)) / 3 for ring in face.rings)


def newell(ring: np.ndarray) -> np.ndarray:
    return np.cross(ring - ring[0], np.roll(ring, -1, axis=0) - ring[0]).sum(axis=0) / 2


def test_triangles_become_the_outline_they_make_up() -> None:
    corners = [[0, 0], [4, 0], [4, 3], [0, 3], [1, 1], [2, 1], [2, 2], [1, 2]]
    pairs = [(0, 1, 5), (0, 5, 4), (1, 2, 6), (1, 6, 5), (2, 3, 7), (2, 7, 6), (3, 0, 4), (3, 4, 7)]
    (outline,) = chart_outlines(np.array([[corners[i] for i in t] for t in pairs], float))
    assert outline.area == pytest.approx(11)
    assert len(outline.interiors) == 1
    assert not outline.exterior.is_ccw, "y counts down"
    overlapping = np.array([[[0, 0], [2, 0], [0, 2]], [[0, 0], [2, 0], [0, 2]]], float)
    assert sum(part.area for part in chart_outlines(overlapping)) == pytest.approx(4), "no triangle is lost"


def test_openings_stay_within_their_wall_and_apart(drawn: PackedCharts) -> None:
    wall = shapely.box(0, 0, 10, 6)
    elements = [
        Element("window", 1, 1, 2, 2.5),
        Element("window", 2, 1, 3, 2.5),  # touches the first
        Element("window", 5, 3, 7, 5.5),
        Element("door", 6, 4, 7, 6.4),  # overlaps a window, reaches below the ground
        Element("window", 9, 1, 12, 2),  # goes on beyond the wall's end
        Element("window", 9.9, 3, 12, 4),  # hardly on the wall
        Element("balcony", 1, 2.5, 3, 3),
    ]
    openings = place_openings(wall, elements)
    assert [e.label for e, _ in openings] == ["door", *4 * ["window"]]
    within = wall.buffer(-0.0499, join_style="mitre")
    assert all(within.contains(o) for _, o in openings)
    apart = [a.distance(b) for k, (_, a) in enumerate(openings) for _, b in openings[:k]]
    assert min(apart) > 0.0599
    assert openings == place_openings(wall, elements[::-1]), "in whatever order they come"


def test_windows_go_on_behind_the_railing_of_a_balcony() -> None:
    seen = [
        Element("balcony", 1, 3, 4, 4),
        Element("window", 1.5, 1.5, 2.5, 2.9),  # ends at the railing
        Element("window", 3, 1.5, 3.8, 3.2),  # overlaps it
        Element("window", 3.9, 1.5, 4.9, 2.9),  # beside its end
        Element("window", 1.5, 0.2, 2.5, 1.2),  # a floor above
        Element("door", 6, 4, 7, 6),
    ]
    found = extend_windows_behind_railings(seen)
    assert [e.y1 for e in found] == pytest.approx([4, 3.75, 3.75, 2.9, 1.2, 6])
    assert [(e.label, e.x0, e.y0, e.x1) for e in found] == [(e.label, e.x0, e.y0, e.x1) for e in seen]
    assert extend_windows_behind_railings(seen[1:]) == seen[1:]


def test_a_building_is_a_watertight_body_with_openings_set_back(drawn: PackedCharts, coloured: TexturedMesh) -> None:
    triangles = group_rows(coloured.charts.building[coloured.mesh.chart])[0]
    wall = next(c for c in np.flatnonzero(coloured.charts.building == 0) if coloured.charts.kind[c] == ChartKind.WALL)
    layout = [Element("window", 1.0, 2.0, 2.5, 4.0), Element("balcony", 4.0, 3.0, 7.0, 4.0)]
    made = build_building_model_parts(drawn, triangles, {wall: "a-0"}, {wall: layout}, ORIGIN)
    assert made.body.is_solid
    faces, surfaces = made.body.faces, made.body.surfaces
    assert watertight(faces)
    volume = sum(volume_under(face) for face in faces)
    assert volume == pytest.approx(20 * 10 * 12 - 1.5 * 2 * 0.15, abs=0.2)
    for face in faces:
        assert (face.page is None) == (surfaces[face.semantic]["type"] == "GroundSurface")
        for place in face.uv:
            assert (place >= 0).all()
            assert (place <= 1).all()
    opening = next(f for f in faces if surfaces[f.semantic]["type"] == "Window")
    assert np.linalg.norm(newell(opening.rings[0])) == pytest.approx(3.0, abs=0.01)
    assert surfaces[surfaces[opening.semantic]["parent"]] == {"type": "WallSurface", "facade": "a-0"}
    whole = next(f for f in faces if len(f.rings) == 2)
    normal = newell(whole.rings[0])
    assert normal @ newell(whole.rings[1]) < 0, "holes run the other way"
    behind = (whole.rings[0][0] - opening.rings[0][0]) @ normal / np.linalg.norm(normal)
    assert behind == pytest.approx(0.15, abs=0.002)
    ((facade, balcony),) = made.balconies
    assert facade == "a-0"
    assert watertight(balcony.faces)
    body = 3 * 1 * 0.9 - (3 - 0.12) * (0.9 - 0.06) * (1 - 0.15)
    assert sum(volume_under(face) for face in balcony.faces) == pytest.approx(body, abs=1e-3)
    assert all(face.page is not None for face in balcony.faces)


def test_panes_that_are_drawn_on_an_assumed_roof_are_no_openings(drawn: PackedCharts, coloured: TexturedMesh) -> None:
    triangles = group_rows(coloured.charts.building[coloured.mesh.chart])[0]
    roof = np.flatnonzero((coloured.charts.building == 0) & (coloured.charts.kind == ChartKind.ROOF))[:1]
    kind = coloured.charts.kind.copy()
    kind[roof] = ChartKind.WINDOW
    with_pane = replace(drawn, source=replace(drawn.source, charts=replace(drawn.source.charts, kind=kind)))
    for assumed, named in ((False, "Window"), (True, "RoofSurface")):
        body = build_building_model_parts(with_pane, triangles, {}, {}, ORIGIN, has_assumed_roof=assumed).body
        types = {body.surfaces[face.semantic]["type"] for face in body.faces}
        assert (named in types, "Window" in types) == (True, not assumed)


def test_a_geometry_indexes_its_tables(drawn: PackedCharts, coloured: TexturedMesh) -> None:
    triangles = group_rows(coloured.charts.building[coloured.mesh.chart])
    pool = VertexPool(ORIGIN)
    body = build_building_model_parts(drawn, triangles[1], {}, {}, ORIGIN).body
    geometry = build_geometry(body.faces, body.surfaces, pool, "2", "Solid")
    pieces = ground_faces(drawn, triangles[-1], ORIGIN)
    terrains = [build_geometry(faces, (), pool, "2", "CompositeSurface") for faces in pieces]
    tables = pool.tables(["p.jpg"] * 9)
    assert not any("semantics" in terrain for terrain in terrains)
    assert len(geometry["semantics"]["values"][0]) == len(geometry["boundaries"][0]) == 6
    shells = [(geometry["boundaries"][0], geometry["texture"]["streetloom"]["values"][0])]
    shells += [(t["boundaries"], t["texture"]["streetloom"]["values"]) for t in terrains]
    used = {tuple(tables["vertices"][i]) for boundaries, _ in shells for s in boundaries for r in s for i in r}
    assert {tuple(v) for v in tables["vertices"]} == used
    for boundaries, textures in shells:
        for surface, texture in zip(boundaries, textures, strict=True):
            for ring, places in zip(surface, texture, strict=True):
                assert len(set(ring)) == len(ring) >= 3
                assert places == [None] or len(places) == len(ring) + 1
    low, high = np.split(np.array(pool.extent()), 2)
    np.testing.assert_allclose(high[2] - low[2], 9.0)


def test_rings_meet_no_corner_twice_and_have_area() -> None:
    pool = VertexPool(np.zeros(3))
    spike = np.array([[0, 0, 0], [4, 0, 0], [4, 0, 4], [4, 0, 4.0002], [2, 0, 4], [2, 0, 6], [2, 0, 4], [0, 0, 4]])
    corners, _ = pool.add_ring(spike, None)
    assert len(corners) == len(set(corners)) == 5
    line = np.array([[0, 0, 0], [4, 0, 0], [8, 0, 0.0001]])
    assert pool.add_ring(line, None) == ([], [])
    geometry = build_geometry(
        [ModelFace((line,), 0), ModelFace((spike,), 1)], [{"type": "Window"}, {"type": "Door"}], pool, "2"
    )
    assert geometry["semantics"] == {"surfaces": [{"type": "Door"}], "values": [0]}
    assert "texture" not in geometry
