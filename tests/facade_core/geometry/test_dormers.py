"""Dormers and rooflights stand on assumed roofs over streets, within their facets and below their ridges, always the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from facade_core.core.types import Building, Roof, Street
from facade_core.geometry.block_surfaces import build_block_surfaces
from facade_core.geometry.charts import ChartKind, Charts, Mesh
from facade_core.geometry.ground.terrain import build_terrain

OUTLINE = shapely.box(0, 0, 30, 14)
STREET = Street("s", None, shapely.LineString([(-20, -8), (60, -8)]))
ROOFS = {
    "gabled": Roof("gabled", 4.2, pitch=31.0, confidence=0.5),
    "mansard": Roof("mansard", 4.4, pitch=66.0, confidence=0.5),
    "hipped": Roof("hipped", 4.2, pitch=31.0, confidence=0.5),
}


def surfaces(id: str, roof: Roof) -> tuple[Charts, Mesh]:
    house = Building(id, OUTLINE, 9.0, "levels", roof=roof)
    return build_block_surfaces([house], [STREET], terrain=build_terrain([], None), ground_margin=20, largest=100)[:2]


def panes(charts: Charts) -> np.ndarray:
    return np.flatnonzero(charts.kind == ChartKind.WINDOW)


@pytest.mark.parametrize("shape", list(ROOFS))
def test_they_stand_over_the_street_and_on_the_roof(shape: str) -> None:
    kinds = set()
    plain, mesh = surfaces("0", replace(ROOFS[shape], confidence=1.0))
    bare = int((plain.kind[mesh.chart] != ChartKind.METAL).sum())
    for id in map(str, range(16)):
        charts, mesh = surfaces(id, ROOFS[shape])
        found = panes(charts)
        upright = np.abs(charts.normals()[found, 2]) < 0.01
        assert upright.all() or not upright.any(), "a house has the ones or the others"
        kinds.add("none" if not len(found) else "dormers" if upright.all() else "rooflights")
        corners = mesh.vertices[np.isin(mesh.vertex_chart, found)]
        assert (charts.normals()[found, 1] < 0.1).all(), "nobody sees the back"
        assert shapely.contains_xy(OUTLINE, corners[:, 0], corners[:, 1]).all()
        assert len(corners) == 0 or (corners[:, 2].min() > 9 and corners[:, 2].max() < 9 + ROOFS[shape].height)
        metal = int((charts.kind[mesh.chart] == ChartKind.METAL).sum())
        more = len(mesh.triangles) - metal - bare
        assert more <= 20 + 11 * len(found), "beside a chimney, gutters and vents"
    assert kinds == ({"none", "dormers"} if shape == "mansard" else {"none", "dormers", "rooflights"})


@pytest.mark.parametrize("shape", list(ROOFS))
def test_cheeks_end_on_the_roof_and_all_lies_on_its_chart(shape: str) -> None:
    rise = np.tan(np.radians(66 if shape == "mansard" else 31))
    dormers = 0
    for id in map(str, range(8)):
        charts, mesh = surfaces(id, ROOFS[shape])
        a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
        assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), charts.normals()[mesh.chart]) > 0).all()
        own = np.isin(charts.kind[mesh.vertex_chart], (ChartKind.WALL, ChartKind.WINDOW))
        off = np.einsum(
            "ij,ij->i", mesh.vertices - charts.origin[mesh.vertex_chart], charts.normals()[mesh.vertex_chart]
        )
        assert np.abs(off[own]).max() < 1e-6
        found = panes(charts)
        front = (np.abs(charts.normals()[found, 2]) < 0.01) & (charts.normals()[found, 1] < -0.99)
        aside = (charts.kind == ChartKind.WALL) & (np.abs(charts.normals()[:, 0]) > 0.99) & (charts.size[:, 1] < 1.7)
        cheeks = [
            mesh.vertices[mesh.triangles[mesh.chart_triangles(chart)[0]]]
            for chart in np.flatnonzero(aside).tolist()
            if len(mesh.chart_triangles(chart)) == 1 and charts.size[chart, 0] > 0.5
        ]
        assert len(cheeks) == 2 * front.sum()
        for corners in cheeks:
            back = corners[np.argmax(corners[:, 1])]
            assert back[2] == pytest.approx(9 + back[1] * rise, abs=0.02)
        dormers += int(front.sum())
    assert dormers


def test_none_on_a_stated_roof_and_always_the_same() -> None:
    stated = replace(ROOFS["gabled"], confidence=1.0)
    ids = list(map(str, range(8)))
    assert not any(len(panes(surfaces(id, stated)[0])) for id in ids)
    id = next(id for id in ids if len(panes(surfaces(id, ROOFS["gabled"])[0])))
    one, other = surfaces(id, ROOFS["gabled"])[1], surfaces(id, ROOFS["gabled"])[1]
    np.testing.assert_array_equal(one.vertices, other.vertices)


def test_walls_and_their_order_are_those_of_a_house_without() -> None:
    """So ids of facades stay."""
    stated = surfaces("0", replace(ROOFS["mansard"], confidence=1.0))[0]
    for id in map(str, range(4)):
        charts = surfaces(id, ROOFS["mansard"])[0]
        first, other = (
            np.flatnonzero((one.building == 0) & (one.kind == ChartKind.WALL))[:4] for one in (charts, stated)
        )
        np.testing.assert_array_equal(charts.origin[first], stated.origin[other])
        assert (charts.kind == ChartKind.CEILING).sum() == (stated.kind == ChartKind.CEILING).sum()
