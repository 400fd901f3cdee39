"""Which walls of a block get what: fronts, backs, courtyards, party walls, a round tower, and what storeys lie on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import shapely
from scipy import ndimage

from benchmarks.painter.facade import paint_facade as paint
from facade_core.core.labels import FacadeClass
from facade_core.core.types import Building, IngestSettings, Roof, Street
from facade_core.facade.texture.building_walls import compose_wall
from facade_core.facade.texture.retargeting import ExemplarAnalysis, analyse_exemplar
from facade_core.facade.texture.settings import FLOORS
from facade_core.facade.texture.wall_floors import FacadeWall, stack_floors
from facade_core.geometry.buildings.roof_shapes import build_shell_with_roof
from facade_core.geometry.settings import FACADE_WALLS
from facade_core.geometry.walls import WallRole, wall_outline_and_free_part
from facade_core.plan.facade_walls import facade_wall
from facade_core.plan.facades import Facades
from facade_core.plan.ingest import BlockInputs, build_plan
from facade_core.plan.plan import Plan

MPP = 0.0625
L_SHAPED = shapely.Polygon([(0, 0), (20, 0), (20, 10), (10, 10), (10, 22), (0, 22)])
LOWER = shapely.box(20, 0, 34, 10)
COURT = shapely.Polygon(shapely.box(40, 0, 70, 26).exterior, [shapely.box(50, 10, 60, 18).exterior])
ROUND = shapely.Point(84, 6).buffer(4.0, quad_segs=4)
BUILDINGS = [
    Building("ell", L_SHAPED, 16.0, "height"),
    Building("low", LOWER, 9.6, "height"),
    Building("court", COURT, 19.2, "height"),
    Building("tower", ROUND, 12.8, "height"),
]


def plan_of(walls: str, buildings: Sequence[Building] = BUILDINGS) -> Plan:
    return build_plan(
        BlockInputs(buildings, [Street("s", "s", shapely.LineString([(-5, -8), (95, -8)]))], floor_height=3.2),
        IngestSettings(
            texels_per_metre=8.0,
            viewpoint_spacing=8.0,
            viewpoint_height=2.5,
            visibility_range=40.0,
            panorama_width=128,
            walls=walls,
        ),
    )


@pytest.fixture(scope="module")
def plan() -> Plan:
    return plan_of("exemplar")


@pytest.fixture(scope="module")
def style() -> ExemplarAnalysis:
    painted = paint((16.2, 14.0), floors=5, columns=5, style="brick", metres_per_pixel=MPP, seed=2)
    return analyse_exemplar(painted.image, painted.labels)


def on(plan: Plan, building: str, direction: tuple[float, float]) -> list[int]:
    """The facades of a building that face somewhere."""
    facades, normal = plan.facades, plan.scene.charts.normals()[plan.facades.chart]
    names = [id_.rpartition("-")[0] for id_ in facades.id]
    return [i for i, name in enumerate(names) if name == building and normal[i, :2] @ direction > 0.99]


def test_every_wall_that_stands_free_is_a_facade(plan: Plan) -> None:
    facades = plan.facades
    counts = {name: sum(id_.startswith(f"{name}-") for id_ in facades.id) for name in ("ell", "low", "court", "tower")}
    assert counts == {"ell": 6, "low": 3, "court": 8, "tower": 16}, "of the lower one the party wall is left out"
    assert [facades.role[i] for name in ("ell", "low", "court") for i in on(plan, name, (0, -1))[:1]] == [
        WallRole.STREET
    ] * 3
    assert all(facades.role[i] == WallRole.BACK for name in ("ell", "low") for i in on(plan, name, (0, 1)))
    assert not plan.writable[facades.chart].any()


def test_translated_walls_are_left_to_the_streets() -> None:
    facades = plan_of("translate").facades
    assert (facades.role == WallRole.STREET).all()
    assert facades.width.min() >= 3


def test_a_wall_over_a_lower_neighbour_is_free_above_it(plan: Plan) -> None:
    (east,) = [i for i in on(plan, "ell", (1, 0)) if abs(plan.facades.width[i] - 10) < 0.1]
    whole, free = wall_outline_and_free_part(plan.scene.charts, plan.scene.mesh, int(plan.facades.chart[east]))
    assert whole.area == pytest.approx(160, rel=0.01)
    assert free.area == pytest.approx(64, rel=0.02)
    assert free.bounds[3] == pytest.approx(16 - 9.6, abs=0.1), "metres from the top"


def test_a_wall_that_begins_on_a_roof_has_no_ground_floor(style: ExemplarAnalysis) -> None:
    """A tower stands on the podium that the street passes, both given as models."""
    podium = Building("podium", shapely.box(0, 0, 40, 14), 6.0, "height", base=0.0)
    tower = Building("tower", shapely.box(8, 2, 32, 12), 12.8, "height", base=0.0, roof=Roof("gabled", 3.0))
    plan = plan_of("exemplar", [podium, replace(tower, shell=build_shell_with_roof(tower, 6.0), roof=None)])
    facades, charts = plan.facades, plan.scene.charts
    begins = charts.origin[facades.chart, 2] - facades.height
    np.testing.assert_array_equal(facades.raised, begins > 5.9)
    assert facades.raised.sum() == 6, (
        "four walls and two gables; below, what closes the gap to the ground is in the podium"
    )
    for building, entered in (("podium", True), ("tower", False)):
        front = max(on(plan, building, (0, -1)), key=lambda i: begins[i])
        wall = facade_wall(plan.scene, facades, front)
        assert wall.on_street
        assert (
            np.isin(compose_wall(style, wall, metres_per_pixel=MPP)[1], (FacadeClass.DOOR, FacadeClass.SHOP)).any()
            == entered
        ), building


def test_what_is_round_is_one(plan: Plan) -> None:
    facades = plan.facades
    tower = [i for i, id_ in enumerate(facades.id) if id_.startswith("tower-")]
    own = facades.run_members(tower[5])
    assert sorted(own.tolist()) == tower
    np.testing.assert_allclose(facades.along[own], np.append(0, np.cumsum(facades.width[own])[:-1]), atol=1e-6)
    assert (facades.role[own] == WallRole.STREET).all()
    assert facade_wall(plan.scene, facades, tower[3]).width == pytest.approx(25, abs=0.5)
    assert len(facades.run_members(on(plan, "ell", (0, -1))[0])) == 1
    for one in range(len(facades)):
        assert set(facades.run_members(one).tolist()) == set(np.flatnonzero(facades.run == facades.run[one]).tolist())
    is_facade = [plan.is_facade(chart) for chart in range(len(plan.scene.charts))]
    assert np.flatnonzero(is_facade).tolist() == sorted(facades.chart.tolist())


def windows(labels: np.ndarray) -> list[tuple[slice, slice]]:
    return ndimage.find_objects(ndimage.label(labels == FacadeClass.WINDOW)[0])


def shown(plan: Plan, style: ExemplarAnalysis, facade: int) -> tuple[FacadeWall, np.ndarray]:
    wall = facade_wall(plan.scene, plan.facades, facade)
    return wall, compose_wall(style, wall, metres_per_pixel=MPP, seed=facade)[1]


def test_a_round_wall_of_narrow_facets_has_windows_on_coarse_atlases(style: ExemplarAnalysis) -> None:
    """Facets of 2.35 m, atlas of 4 texels a metre: the usual margin of three texels leaves no window."""
    gasometer = Building("gasometer", shapely.Point(40, 8).buffer(12.0, quad_segs=16), 20.0, "height")
    plan = plan_of("exemplar", [gasometer])
    facades = plan.facades
    assert len(np.unique(facades.run)) == 1, "one facade round the tower"
    wall = facade_wall(plan.scene, facades, 0)
    labels = compose_wall(style, wall, metres_per_pixel=MPP, seed=1, texel_m=0.25)[1]
    assert len(windows(labels)) > 20
    seams = np.array(wall.seams) / MPP
    for _, columns in windows(labels):
        assert not ((seams > columns.start + 1) & (seams < columns.stop - 1)).any(), "no window is bent"


@pytest.mark.parametrize("radius", [3.0, 5.0])
def test_a_round_tower_of_32_facets_has_whole_windows_across_them(style: ExemplarAnalysis, radius: float) -> None:
    """Facets of .59 and .98 m, narrower than a window, of a model; outlines are simplified."""
    tower = Building("tower", shapely.Point(40, 8).buffer(radius, quad_segs=8), 16.0, "height", base=0.0)
    shell = build_shell_with_roof(replace(tower, roof=Roof("pyramidal", 3.0)), 0.0)
    plan = plan_of("exemplar", [replace(tower, shell=shell)])
    facades = plan.facades
    assert len(facades) == 32
    assert len(np.unique(facades.run)) == 1
    wall = facade_wall(plan.scene, facades, 0)
    assert not wall.seams
    labels = compose_wall(style, wall, metres_per_pixel=MPP, seed=1, texel_m=0.125)[1]
    found = windows(labels)
    assert len(found) >= 4 * int(wall.width / 4)
    sides = np.array([[one.stop - one.start for one in box] for box in found])
    assert np.median(sides[:, 1]) * MPP > 0.9, "as wide as on a flat wall"


def test_narrow_pieces_beside_a_wall_are_no_facades() -> None:
    chamfered = shapely.Polygon([(0, 0.5), (0.5, 0), (12, 0), (12, 10), (0, 10)])
    facades = plan_of("exemplar", [Building("house", chamfered, 12.8, "height")]).facades
    assert facades.width.min() > 0.7


def test_no_window_is_cut_by_a_walls_edge_or_a_neighbour(plan: Plan, style: ExemplarAnalysis) -> None:
    facades = plan.facades
    for facade in np.flatnonzero(facades.run == np.arange(len(facades))).tolist():
        wall, labels = shown(plan, style, facade)
        assert not (labels[:, [0, -1]] == FacadeClass.WINDOW).any(), facades.id[facade]
        for rows, columns in windows(labels):
            box = shapely.box(*(MPP * np.array([columns.start, rows.start, columns.stop, rows.stop])))
            assert wall.free.buffer(2 * MPP).covers(box), facades.id[facade]
        if wall.is_back:
            assert not (labels == FacadeClass.SHOP).any()
            assert wall.has_back_door or not (labels == FacadeClass.DOOR).any()
    (east,) = [i for i in on(plan, "ell", (1, 0)) if abs(facades.width[i] - 10) < 0.1]
    assert windows(shown(plan, style, east)[1]), "above the neighbour it has some"


@pytest.mark.parametrize("seams", [(7.3, 20.0), (1.0, 16.4, 17.9), tuple(np.arange(2.4, 30, 2.4).tolist())])
def test_no_window_lies_on_a_seam_between_walls_that_are_laid_out_as_one(
    style: ExemplarAnalysis, seams: tuple[float, ...]
) -> None:
    wall = FacadeWall(30, 16, 0, 16, 5, True, False, shapely.box(0, 0, 30, 16), seams=seams)
    for street, plain in ((True, False), (False, True)):
        labels = compose_wall(style, replace(wall, on_street=street, is_back=plain), metres_per_pixel=MPP)[1]
        at = np.rint(np.array(seams) / MPP).astype(int)
        assert not (labels[:, at] == FacadeClass.WINDOW).any()
        assert len(windows(labels)) >= 20


def test_windows_of_facets_are_whole_in_the_texels_that_show_them(style: ExemplarAnalysis) -> None:
    for facet, texel, some in ((2.4, 1 / 8, True), (1.7, 1 / 8, True), (1.0, 1 / 32, True), (0.72, 1 / 8, False)):
        seams = np.arange(facet, 12 * facet - 0.01, facet)
        size = 12 * facet, 16
        wall = FacadeWall(*size, 0, 16, 5, False, True, shapely.box(0, 0, *size), seams=tuple(seams.tolist()))
        labels = compose_wall(style, wall, metres_per_pixel=MPP, texel_m=texel)[1]
        assert bool(windows(labels)) == some
        for _, columns in windows(labels):
            ends = MPP * np.array([columns.start, columns.stop])
            assert np.abs(ends[:, None] - np.array([0, *seams, size[0]])).min() > 2 * texel - MPP
            assert not ((seams > ends[0]) & (seams < ends[1])).any()


def test_gables_and_narrow_walls(style: ExemplarAnalysis) -> None:
    gable = shapely.Polygon([(0, 6), (6, 0), (12, 6), (12, 22), (0, 22)])
    labels = compose_wall(style, FacadeWall(12, 22, 0, 16, 5, False, True, gable), metres_per_pixel=MPP)[1]
    over = [w for w in windows(labels) if w[0].stop * MPP < 6]
    for rows, columns in windows(labels):
        corners = MPP * np.array([[columns.start, rows.start], [columns.stop, rows.start]])
        assert gable.buffer(2 * MPP).covers(shapely.MultiPoint(corners))
    assert len(over) < len(windows(labels)) / 4
    narrow = compose_wall(
        style, FacadeWall(0.9, 16, 0, 16, 5, False, False, shapely.box(0, 0, 0.9, 16)), metres_per_pixel=MPP
    )[1]
    assert not windows(narrow)
    fits = compose_wall(
        style, FacadeWall(2.9, 16, 0, 16, 5, False, False, shapely.box(0, 0, 2.9, 16)), metres_per_pixel=MPP
    )[1]
    assert len(windows(fits)) == 5


def test_bare_wall_above_a_low_storey_is_plain(style: ExemplarAnalysis) -> None:
    waves = 0.25 * np.sin(np.arange(style.image.shape[0]) / 4) + 1
    stained = analyse_exemplar(np.clip(waves[:, None, None] * style.image, 0, 255).astype(np.uint8), style.labels)
    wall = FacadeWall.freestanding(5.9, 12.0, 1)
    attic = stack_floors(stained, wall, MPP)[0][0].attic
    assert attic > 0.5
    image, labels = compose_wall(stained, wall, metres_per_pixel=MPP)
    foot = round(attic / MPP)
    assert (labels[:foot] == FacadeClass.WALL).all()
    plain = image[round(0.2 / MPP) : foot - round(0.2 / MPP)].mean(axis=(1, 2))
    assert np.ptp(plain) < FLOORS.grain
    assert image[foot - 1].mean() > plain.max() + FLOORS.grain > plain.min() > image[foot].mean(), "over a ledge"


def test_storeys_meet_round_the_corners_and_are_of_a_storeys_height(plan: Plan, style: ExemplarAnalysis) -> None:
    facades: Facades = plan.facades
    for name in ("ell", "low", "court"):
        lines = []
        for facade in [i for i, id_ in enumerate(facades.id) if id_.startswith(f"{name}-")]:
            wall = facade_wall(plan.scene, facades, facade)
            lines.append(np.cumsum(wall_storeys(style, wall)[::-1]))
        assert all(len(one) == len(lines[0]) for one in lines)
        np.testing.assert_allclose(lines, np.broadcast_to(lines[0], (len(lines), len(lines[0]))), atol=MPP)
        heights = np.diff(np.append(0, lines[0]))
        assert FACADE_WALLS.floor_height_m[0] - 0.01 <= heights.min()
        assert heights.max() <= FACADE_WALLS.floor_height_m[1] + 0.01


def wall_storeys(style: ExemplarAnalysis, wall: FacadeWall) -> list[float]:
    """The heights of a wall's storeys, from the top."""
    return [float(np.sum(storey.all_heights)) for storey in stack_floors(style, wall, MPP)[0]]


def test_a_lower_part_of_a_building_keeps_its_storeys(style: ExemplarAnalysis) -> None:
    tall = FacadeWall.freestanding(19.2, 12.0, floors=6)
    low = FacadeWall(9, 9.0, 0.0, 19.2, 6, True, False, shapely.box(0, 0, 9, 9.0))
    high, lower = (np.cumsum(wall_storeys(style, wall)[::-1]) for wall in (tall, low))
    np.testing.assert_allclose(high[: len(lower) - 1], lower[:-1], atol=1e-6)


def test_a_wall_is_roofed_by_what_the_model_states_of_its_roof() -> None:
    flat = Building("flat", shapely.box(0, 0, 12, 10), 9.6, "height", roof=Roof("flat", 0.0, confidence=0.6))
    buildings = [
        flat,
        replace(flat, id="stated", footprint=shapely.box(20, 0, 32, 10), roof=Roof("flat", 0.0)),
        replace(flat, id="gable", footprint=shapely.box(40, 0, 52, 10), roof=Roof("gabled", 3.0, confidence=0.4)),
        replace(flat, id="none", footprint=shapely.box(60, 0, 72, 10), roof=None),
    ]
    model = replace(flat, id="model", footprint=shapely.box(80, 0, 92, 10), base=0.0)
    buildings.append(
        replace(model, shell=build_shell_with_roof(replace(model, roof=Roof("gabled", 3.0)), 0.0), roof=None)
    )
    facades = plan_of("exemplar", buildings).facades
    roofed = {name.rpartition("-")[0]: bool(has) for name, has in zip(facades.id, facades.roofed, strict=True)}
    assert roofed == {"flat": False, "stated": True, "gable": True, "none": False, "model": True}
