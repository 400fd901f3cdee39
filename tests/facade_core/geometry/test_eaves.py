"""Roofs stand out over walls that nobody stands beside, flat ones have a parapet, and the rest of a building stays as it is."""

from __future__ import annotations

import numpy as np
import shapely

from facade_core.core.types import Building, Roof, Street
from facade_core.geometry.block_surfaces import build_block_surfaces
from facade_core.geometry.buildings.settings import EAVES
from facade_core.geometry.charts import ChartKind, Charts, Mesh
from facade_core.geometry.ground.terrain import build_terrain

HOUSE = Building("a", shapely.box(0, 0, 20, 10), 9.0, "levels", roof=Roof("gabled", 2.0, pitch=25.0))
STREET = Street("s", None, shapely.LineString([(-20, -8), (60, -8)]))


def surfaces(*buildings: Building) -> tuple[Charts, Mesh]:
    terrain = build_terrain(buildings, None)
    charts, mesh, refused = build_block_surfaces(buildings, [STREET], terrain=terrain, ground_margin=20, largest=100)
    assert not refused
    return charts, mesh


def corners(charts: Charts, mesh: Mesh, building: int, *kinds: int) -> np.ndarray:
    own = (charts.building[mesh.chart] == building) & np.isin(charts.kind[mesh.chart], kinds)
    return mesh.vertices[mesh.triangles[own]].reshape(-1, 3)


def test_eaves_stand_out_towards_the_street_only() -> None:
    charts, mesh = surfaces(HOUSE)
    roof = corners(charts, mesh, 0, ChartKind.ROOF)
    assert np.isclose(roof[:, 1].min(), -EAVES.overhang_m)
    assert roof[:, 1].max() < 10 + 1e-6, "nobody sees the back"
    assert 8.5 < roof[:, 2].min() < 9.0, "the slope goes on"
    below = corners(charts, mesh, 0, ChartKind.CEILING)
    assert len(below)
    assert (charts.normals()[charts.kind == ChartKind.CEILING][:, 2] < 0).all()
    assert below[:, 2].min() > 8.3


def test_what_is_drawn_lies_on_its_chart() -> None:
    charts, mesh = surfaces(HOUSE)
    off = np.einsum("ij,ij->i", mesh.vertices - charts.origin[mesh.vertex_chart], charts.normals()[mesh.vertex_chart])
    bent = charts.kind[mesh.vertex_chart] == ChartKind.METAL
    assert np.abs(off[~bent]).max() < 1e-3
    assert 0 < np.abs(off[bent]).max() < 0.09, "gutters and pipes bend about theirs"
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), charts.normals()[mesh.chart]) > 0).all()


def test_no_eaves_over_a_neighbour_that_is_as_high_but_over_a_lower_one() -> None:
    house = Building("a", shapely.box(0, 0, 20, 10), 9.0, "levels", roof=Roof("skillion", 2.0, direction=180.0))
    front = shapely.box(8, -3, 20, 0)
    for height, reach in ((12.0, 8.0), (4.0, 20.0)):
        charts, mesh = surfaces(house, Building("b", front, height, "levels"))
        roof = corners(charts, mesh, 0, ChartKind.ROOF)
        assert np.isclose(roof[roof[:, 1] < -0.1, 0].max(), reach, atol=0.3)


def test_walls_and_their_order_are_those_of_a_house_without_eaves() -> None:
    hidden = (Building("b", shapely.box(-30, -4, 50, -3), 30.0, "levels"),)
    open_, closed = surfaces(HOUSE)[0], surfaces(HOUSE, *hidden)[0]
    for one in (open_, closed):
        first = np.flatnonzero((one.building == 0) & (one.kind == ChartKind.WALL))[:4]
        np.testing.assert_array_equal(one.size[first], [[10, 9], [20, 9], [10, 9], [20, 9]])
    assert not (closed.kind[closed.building == 0] == ChartKind.CEILING).any()


def test_a_flat_roof_has_a_parapet_but_at_its_neighbour() -> None:
    flat = Building("a", shapely.box(0, 0, 20, 10), 9.0, "levels", roof=Roof("flat", 0.0))
    charts, mesh = surfaces(flat, Building("b", shapely.box(20, 0, 30, 10), 9.0, "levels", roof=Roof("flat", 0.0)))
    top = corners(charts, mesh, 0, ChartKind.ROOF, ChartKind.WALL)
    assert np.isclose(top[:, 2].max(), 9 + EAVES.parapet_m)
    assert shapely.box(0, 0, 20, 10).buffer(1e-6).covers(shapely.multipoints(top[:, :2]))
    upper = top[top[:, 2] > 9.1]
    assert set(np.unique(upper[:, 0]).tolist()) == {0.0, 20.0}
    east = (charts.building == 0) & (charts.normals()[:, 0] > 0.9) & (charts.size[:, 0] > 9)
    assert east.sum() == 1, "only the wall"


def test_low_roofs_and_given_ones_are_left() -> None:
    low = Building("a", shapely.box(0, 0, 6, 5), 2.6, "levels", roof=Roof("flat", 0.0))
    charts, _ = surfaces(low)
    assert (charts.building == 0).sum() == 5
