"""Passages of streets through extruded buildings."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from facade_core.core.types import Building, BuildingPassage, IngestSettings, Roof, Street
from facade_core.export.bodies.building_body import build_body
from facade_core.export.bodies.footprints import building_footprint
from facade_core.export.models.textured_mesh import build_textured_mesh
from facade_core.geometry.block_surfaces import build_block_surfaces
from facade_core.geometry.buildings.passages import footprint_without_headroom
from facade_core.geometry.charts import ChartKind, Charts, Mesh
from facade_core.geometry.ground.terrain import Terrain
from facade_core.geometry.raycast import MISS, RayCaster
from facade_core.plan.ingest import BlockInputs, build_plan
from facade_core.plan.plan import Plan

LEVEL = Terrain(0.0, 0.0, 1.0, np.zeros((1, 1)))
SLOPE = Terrain(0.0, -20.0, 100.0, np.array([[0.0, 0.0], [4.0, 4.0]]))  # 4 cm up per metre northwards
THROUGH = Street("s", "Hof", shapely.LineString([(20, -20), (20, 40)]))
ALONG = Street("t", "High Street", shapely.LineString([(-10, -8), (50, -8)]))


def corridor(*points: tuple[float, float], width: float = 4.0) -> shapely.Polygon:
    return shapely.LineString(points).buffer(width / 2, cap_style="flat", join_style="mitre")


STRAIGHT = BuildingPassage(corridor((20, -2), (20, 12)), 3.5)


def house(*passages: BuildingPassage, height: float = 12.0, roof: Roof | None = None, raised: float = 0.0) -> Building:
    outline = shapely.box(0, 0, 40, 10)
    return Building("a", outline, height, "height", roof=roof, raised=raised, passages=passages)


def build(*buildings: Building, terrain: Terrain = LEVEL) -> tuple[Charts, Mesh]:
    charts, mesh, refused = build_block_surfaces(
        buildings, [THROUGH], terrain=terrain, ground_margin=30.0, largest=100.0
    )
    assert not refused
    return charts, mesh


def volume(charts: Charts, mesh: Mesh, kinds: tuple[ChartKind, ...] = tuple(ChartKind)) -> float:
    """Return the volume over z = 0 that the surfaces of buildings enclose."""
    own = (charts.building[mesh.chart] >= 0) & np.isin(charts.kind[mesh.chart], kinds)
    a, b, c = (mesh.vertices[mesh.triangles[own, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def chart_seen(charts: Charts, mesh: Mesh, eye: tuple[float, float, float], ahead: tuple[float, float, float]) -> int:
    return int(RayCaster(mesh).cast(np.array(eye), np.array([ahead]))[1][0])


def test_one_looks_through_and_the_inside_is_closed() -> None:
    charts, mesh = build(house(STRAIGHT))
    plain, _ = build(house())
    assert volume(charts, mesh) == pytest.approx(40 * 10 * 12 - 4 * 10 * 3.5)
    eye = (20.0, -5.0, 2.5)
    assert chart_seen(charts, mesh, eye, (0, 1, 0)) == MISS
    assert charts.kind[chart_seen(charts, mesh, eye, (0, 1, 0.12))] == ChartKind.CEILING
    assert charts.kind[chart_seen(charts, mesh, eye, (0.2, 1, 0))] == ChartKind.WALL
    assert charts.kind[chart_seen(charts, mesh, eye, (0, 1, -0.25))] == ChartKind.GROUND
    north = np.array([0.0, 1.0, 0.0])
    assert charts.normals()[chart_seen(charts, mesh, eye, (0, 1, 0.5))] @ north == -1, "the wall above"
    rows = slice(0, 5)  # walls and roof keep their numbers, frames and sizes
    for one, other in ((charts.origin, plain.origin), (charts.size, plain.size), (charts.kind, plain.kind)):
        np.testing.assert_array_equal(one[rows], other[rows])


@pytest.mark.parametrize(
    "roof", [Roof("flat", 0.0), Roof("gabled", 3.0), Roof("hipped", 3.0), Roof("gabled", 3.0, confidence=0.5)]
)
def test_roofs_go_on_over_a_passage(roof: Roof) -> None:
    opened, plain = (build(house(*passages, roof=roof)) for passages in ((STRAIGHT,), ()))
    assert volume(*plain) - volume(*opened) == pytest.approx(4 * 10 * 3.5)
    roofs = [charts.size[charts.kind == ChartKind.ROOF] for charts, _ in (opened, plain)]
    np.testing.assert_array_equal(*roofs)


@pytest.mark.parametrize(
    ("passage", "area"),
    [
        (BuildingPassage(corridor((10, -8), (30, 18)), 3.5), None),  # askew
        (BuildingPassage(corridor((10, -2), (10, 5), (20, 5), (20, 12)), 3.5), None),  # round two bends
        (BuildingPassage(corridor((38, -2), (38, 12)), 3.5), 40.0),  # along the end wall, which stays open
        (BuildingPassage(corridor((-2, -2), (6, 6), width=3.0), 3.5), None),  # round a corner of the outline
        (BuildingPassage(corridor((20, -2), (20, 6)), 3.5), 24.0),  # to a wall inside
        (BuildingPassage(corridor((20, -2), (20, 12), width=50.0), 3.5), 400.0),  # wider than the building
    ],
)
def test_passages_of_any_course_leave_no_hole(passage: BuildingPassage, area: float | None) -> None:
    area = passage.corridor.intersection(shapely.box(0, 0, 40, 10)).area if area is None else area
    for roof in (None, Roof("gabled", 3.0)):
        opened, plain = build(house(passage, roof=roof)), build(house(roof=roof))
        assert volume(*plain) - volume(*opened) == pytest.approx(area * 3.5, abs=0.01)


def test_passages_that_cross_have_one_ceiling() -> None:
    low = BuildingPassage(corridor((-2, 5), (42, 5), width=2.0), 2.5)
    charts, mesh = build(house(STRAIGHT, low))
    assert volume(charts, mesh) == pytest.approx(40 * 10 * 12 - (4 * 10 + 36 * 2) * 2.5)


def test_a_passage_leads_into_a_courtyard() -> None:
    outline = shapely.box(0, 0, 40, 30).difference(shapely.box(10, 10, 30, 20))
    building = Building("a", outline, 12.0, "height", passages=(STRAIGHT,))
    charts, mesh = build(building)
    assert volume(charts, mesh) == pytest.approx((40 * 30 - 20 * 10) * 12 - 4 * 10 * 3.5)
    seen = chart_seen(charts, mesh, (20.0, -5.0, 2.0), (0, 1, 0))
    assert charts.origin[seen, 1] == pytest.approx(20.0), "the far wall of the courtyard"


def test_adjacent_buildings_are_opened_through_their_party_wall() -> None:
    passage = BuildingPassage(corridor((20, -2), (20, 22)), 3.5)
    front = house(passage)
    rear = Building("b", shapely.box(0, 10, 40, 20), 3.5, "height", passages=(passage,))
    charts, mesh = build(front, rear)
    assert volume(charts, mesh) == pytest.approx(40 * 10 * 15.5 - 4 * 10 * (3.5 + 3.0))
    assert chart_seen(charts, mesh, (20.0, -5.0, 1.5), (0, 1, 0)) == MISS
    lintel = chart_seen(charts, mesh, (20.0, -5.0, 3.2), (0, 1, 0))
    assert charts.building[lintel] == 1, "the rear building is lower, and so is its ceiling"


@pytest.mark.parametrize(("height", "clear"), [(12.0, 3.5), (3.2, 2.7), (2.4, None)])
def test_a_ceiling_is_below_the_eaves(height: float, clear: float | None) -> None:
    charts, mesh = build(house(STRAIGHT, height=height))
    assert volume(charts, mesh) == pytest.approx(40 * 10 * height - 4 * 10 * (clear or 0.0))


def test_a_ceiling_is_high_enough_over_sloping_ground() -> None:
    charts, mesh = build(house(STRAIGHT), terrain=SLOPE)
    (ceiling,) = np.flatnonzero(charts.kind == ChartKind.CEILING)
    assert charts.origin[ceiling, 2] == pytest.approx(3.5 + 30 * 0.04)
    for y in np.arange(0.5, 10):
        below = chart_seen(charts, mesh, (18.5, float(y), 3.0), (0, 0, -1))
        assert charts.kind[below] == ChartKind.GROUND


@pytest.mark.parametrize(("raised", "cut"), [(2.5, 1.0), (3.5, 0.0), (5.0, 0.0)])
def test_a_part_that_begins_above_the_ground_is_cut_below_the_ceiling(raised: float, cut: float) -> None:
    charts, mesh = build(house(STRAIGHT, raised=raised))
    assert volume(charts, mesh) == pytest.approx(40 * 10 * (12 - raised) - 4 * 10 * cut)
    assert not footprint_without_headroom(house(STRAIGHT, raised=raised), LEVEL, 2.8).contains(shapely.Point(20, 5))


def test_cameras_need_headroom() -> None:
    inside = shapely.Point(20, 5)
    assert not footprint_without_headroom(house(STRAIGHT), LEVEL, 2.8).intersects(inside)
    assert footprint_without_headroom(house(STRAIGHT, height=3.0), LEVEL, 2.8).contains(inside)
    assert footprint_without_headroom(house(), LEVEL, 2.8).contains(inside)


def build_block_plan(building: Building) -> Plan:
    settings = IngestSettings(
        texels_per_metre=8.0,
        viewpoint_spacing=5.0,
        viewpoint_height=2.5,
        visibility_range=40.0,
        panorama_width=128,
        walls="exemplar",
    )
    return build_plan(BlockInputs([building], [ALONG, THROUGH], floor_height=3.0), settings)


def facades(plan: Plan) -> dict[str, NDArray[np.float64]]:
    sizes = np.column_stack([plan.facades.width, plan.facades.height]).round(6)
    return dict(zip(plan.facades.id, sizes.tolist(), strict=True))


@pytest.mark.parametrize("roof", [None, Roof("gabled", 3.0)])
def test_facades_stay_whole_and_viewpoints_are_inside(roof: Roof | None) -> None:
    opened, plain = build_block_plan(house(STRAIGHT, roof=roof)), build_block_plan(house(roof=roof))
    assert facades(opened) == facades(plain), "also none inside of the passage"
    inside = [
        [camera for camera in plan.viewpoints if 0 < camera.position[1] < 10 and camera.street == 1]
        for plan in (opened, plain)
    ]
    assert (len(inside[0]), len(inside[1])) == (2, 0)
    floor = opened.scene.charts.kind[opened.scene.visible_charts(inside[0][0], 128)]
    assert {ChartKind.WALL, ChartKind.CEILING, ChartKind.GROUND} <= set(floor.tolist())


@pytest.mark.parametrize("roof", [None, Roof("gabled", 3.0)])
def test_exported_bodies_are_closed_and_footprints_whole(roof: Roof | None) -> None:
    plan = build_block_plan(house(STRAIGHT, roof=roof))
    mesh = build_textured_mesh(plan.scene, lambda page: np.empty((0, 0, 3), np.uint8))
    own = np.flatnonzero(plan.scene.charts.building[plan.scene.mesh.chart] == 0)
    footprint = shapely.union_all(building_footprint(mesh, own))
    assert footprint.symmetric_difference(shapely.box(0, 0, 40, 10)).area < 0.1
    surfaces = dict.fromkeys(range(len(plan.scene.charts)), 0)
    body = build_body(mesh, own, surfaces, 1, np.zeros(3))
    assert body.is_closed
    points = [body.shell.points[list(ring)] for patch in body.shell.patches for ring in patch.rings]
    assert any(abs(ring[:, 2] - 3.5).max() < 0.01 for ring in points), "the ceiling is part of the body"
