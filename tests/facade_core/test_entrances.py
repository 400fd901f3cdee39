"""A narrow corner between two fronts shows their shop; of a building's backs one has a plain door."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from scipy import ndimage

from benchmarks.painter.facade import paint_facade as paint
from facade_core.core.labels import FacadeClass
from facade_core.core.types import Building, IngestSettings, Street
from facade_core.facade.texture.building_walls import compose_wall
from facade_core.facade.texture.doors import lengthen_doors
from facade_core.facade.texture.ground_floor import replace_ground_floor_by_windows
from facade_core.facade.texture.retargeting import ExemplarAnalysis, analyse_exemplar
from facade_core.facade.texture.wall_floors import FacadeWall
from facade_core.geometry.walls import WallRole
from facade_core.plan.doors import has_back_door, is_corner_facade
from facade_core.plan.facade_walls import facade_wall
from facade_core.plan.ingest import BlockInputs, build_plan
from facade_core.plan.plan import Plan
from tasks.stages.facades.stage import facade_entrance_positions

MPP = 0.05
# One corner cut off at the crossing, and a nook with a narrow wall across it at the other end.
CORNER = shapely.Polygon([(0, 1.5), (1.5, 0), (18, 0), (18, 12), (12, 12), (12, 14), (0, 14)])
NOOK = shapely.Polygon([(24, 0), (30, 0), (30, 4), (31.5, 5.5), (36, 5.5), (36, 14), (24, 14)])


@pytest.fixture(scope="module")
def plan() -> Plan:
    return plan_of([Building("corner", CORNER, 12.8, "height"), Building("nook", NOOK, 12.8, "height")])


def plan_of(buildings: list[Building]) -> Plan:
    return build_plan(
        BlockInputs(
            buildings,
            [
                Street("a", "a", shapely.LineString([(-30, -8), (60, -8)])),
                Street("b", "b", shapely.LineString([(-8, -30), (-8, 12)])),
            ],
            floor_height=3.2,
        ),
        IngestSettings(
            texels_per_metre=8.0,
            viewpoint_spacing=6.0,
            viewpoint_height=2.5,
            visibility_range=40.0,
            panorama_width=128,
            walls="exemplar",
        ),
    )


@pytest.fixture(scope="module")
def style() -> ExemplarAnalysis:
    painted = paint((16.2, 14.0), floors=5, columns=5, style="brick", metres_per_pixel=MPP, seed=2)
    assert (painted.labels == FacadeClass.SHOP).any()
    return analyse_exemplar(painted.image, painted.labels)


def test_a_corner_cut_off_between_two_fronts_is_one_and_a_nook_is_none(plan: Plan) -> None:
    facades = plan.facades
    found = [i for i in range(len(facades)) if is_corner_facade(plan.scene.charts, facades, i)]
    assert [facades.id[i].split("-")[0] for i in found] == ["corner"]
    assert facades.width[found[0]] == pytest.approx(np.hypot(1.5, 1.5), abs=0.01)
    assert facade_wall(plan.scene, facades, found[0]).is_corner


def test_a_corner_in_two_pieces_is_one() -> None:
    pieces = shapely.Polygon([(0, 1.9), (0.75, 0.75), (1.9, 0), (18, 0), (18, 12), (0, 12)])
    facades = (plan := plan_of([Building("corner", pieces, 12.8, "height")])).facades
    found = [i for i in range(len(facades)) if is_corner_facade(plan.scene.charts, facades, i)]
    assert len(found) == 2
    assert len(set(facades.run[found].tolist())) == 1


def test_every_building_has_a_back_with_a_door(plan: Plan, style: ExemplarAnalysis) -> None:
    facades = plan.facades
    for name in ("corner", "nook"):
        own = [i for i, id in enumerate(facades.id) if id.startswith(name)]
        doors = [i for i in own if has_back_door(facades, i)]
        backs = [i for i in own if facades.role[i] == WallRole.BACK]
        assert len(doors) == (2 if len(backs) >= 5 else 1)
        assert facades.width[doors].max() == facades.width[backs].max()
        labels = compose_wall(style, facade_wall(plan.scene, facades, doors[0]), metres_per_pixel=MPP, seed=3)[1]
        assert ndimage.label(labels == FacadeClass.DOOR)[1] == 1
        assert (labels[-1] == FacadeClass.DOOR).any()
        assert not (labels == FacadeClass.SHOP).any()


def corner(width: float) -> FacadeWall:
    free = shapely.box(0, 0, width, 16)
    return FacadeWall(width, 16, 0, 16, 5, on_street=False, is_back=False, free=free, is_corner=True)


@pytest.mark.parametrize("width", [3.2, 3.6])
def test_a_corner_shows_the_shop_of_its_building_and_no_storey_moves(style: ExemplarAnalysis, width: float) -> None:
    image, labels = compose_wall(style, corner(width), metres_per_pixel=MPP)
    shop = np.flatnonzero((labels == FacadeClass.SHOP).any(axis=1))
    assert len(shop)
    assert shop.min() * MPP > 16 - 4.6, "at the ground alone"
    assert not np.isin(labels[:, [0, -1]], (FacadeClass.SHOP, FacadeClass.DOOR, FacadeClass.WINDOW)).any(), (
        "nothing is cut at its edges"
    )
    plain = analyse_exemplar(*replace_ground_floor_by_windows(style.image, style.labels, MPP))
    bare_image, bare = compose_wall(plain, corner(width), metres_per_pixel=MPP)
    assert not np.isin(bare, (FacadeClass.SHOP, FacadeClass.DOOR)).any()
    assert image.shape == bare_image.shape


def test_what_is_too_narrow_for_a_shop_has_none(style: ExemplarAnalysis) -> None:
    assert not np.isin(
        compose_wall(style, corner(0.9), metres_per_pixel=MPP)[1], (FacadeClass.SHOP, FacadeClass.DOOR)
    ).any()


def test_a_back_that_is_covered_at_the_ground_has_no_door(style: ExemplarAnalysis) -> None:
    wall = FacadeWall(8, 16, 0, 16, 5, on_street=False, is_back=True, free=shapely.box(0, 0, 8, 10), has_back_door=True)
    assert not (compose_wall(style, wall, metres_per_pixel=MPP)[1] == FacadeClass.DOOR).any()


def doors_of(labels: np.ndarray) -> list[float]:
    """The middles of the doors, metres from the left."""
    parts, _ = ndimage.label(labels == FacadeClass.DOOR)
    return [(at[1].start + at[1].stop) / 2 * MPP for at in ndimage.find_objects(parts)]


def test_a_front_shows_a_door_where_the_map_has_one() -> None:
    painted = paint((16.2, 14.0), floors=5, columns=5, style="brick", metres_per_pixel=MPP, seed=8)
    style = analyse_exemplar(*replace_ground_floor_by_windows(painted.image, painted.labels, MPP))
    assert style.doors.any()
    wide = replace(FacadeWall.freestanding(14, 30, 5), entrances=())
    before = doors_of(compose_wall(style, wide, metres_per_pixel=MPP, seed=3)[1])
    place = max(np.linspace(3, 27, 25).tolist(), key=lambda x: min(abs(x - door) for door in before))
    labels = compose_wall(style, replace(wide, entrances=(place,)), metres_per_pixel=MPP, seed=3)[1]
    after = doors_of(labels)
    assert len(after) == len(before) + 1
    assert min(abs(door - place) for door in after) < 2.0
    again = compose_wall(style, replace(wide, entrances=(before[0],)), metres_per_pixel=MPP, seed=3)[1]
    assert len(doors_of(again)) == len(before), "one that shows is the map's"


def test_a_back_has_its_door_where_the_map_has_it(style: ExemplarAnalysis) -> None:
    wall = FacadeWall(16, 16, 0, 16, 5, on_street=False, is_back=True, free=shapely.box(0, 0, 16, 16))
    assert not doors_of(compose_wall(style, wall, metres_per_pixel=MPP)[1])
    for place in (3.0, 13.0):
        (door,) = doors_of(compose_wall(style, replace(wall, entrances=(place,)), metres_per_pixel=MPP)[1])
        assert abs(door - place) < 2.5


def test_entrances_of_a_map_are_told_by_wall(plan: Plan) -> None:
    found = facade_entrance_positions(plan, [(9.0, -0.4), (15.0, 0.2), (9.0, -5.0), (5.0, 14.0)])
    told = {plan.facades.id[i]: places for i, places in enumerate(found) if places}
    assert len(told) == 2, "of the front and of a back; what is 5 m off is nobody's"
    front, back = sorted(told.values(), key=len, reverse=True)
    assert front == pytest.approx((3.0, 9.0)) or front == pytest.approx((7.5, 13.5))
    assert len(back) == 1


def test_a_door_whose_foot_is_hidden_is_stretched_from_what_is_seen_of_it() -> None:
    labels = np.full((80, 60), FacadeClass.WALL, np.uint8)
    labels[30:, 20:40] = FacadeClass.DOOR
    image = np.full((80, 60, 3), 200, np.uint8)
    image[30:, 20:40] = 60
    image[60:, 10:50] = (255, 0, 255)
    hidden = (image == (255, 0, 255)).all(axis=2)
    longer, carried = lengthen_doors(image, labels, hidden, MPP)
    np.testing.assert_array_equal(carried, labels)
    assert (longer[30:, 20:40] == 60).all()
    assert (longer[30:, 17:20] == 200).all(), "with its surround"
    np.testing.assert_array_equal(longer[:30], image[:30])
    hidden[40:60, 20:40] = True
    plain, carried = lengthen_doors(image, labels, hidden, MPP)
    np.testing.assert_array_equal(carried, labels)
    assert not (plain[30:, 20:40] == (255, 0, 255)).all(axis=2).any(), "nearly all of it is hidden"
    seen, _ = lengthen_doors(image, labels, np.zeros_like(hidden), MPP)
    np.testing.assert_array_equal(seen, image)


def test_a_strip_that_is_labelled_door_stretches_no_window() -> None:
    labels = np.full((80, 120), FacadeClass.WALL, np.uint8)
    labels[40:, 20:40] = labels[76:, 20:110] = FacadeClass.DOOR
    labels[20:60, 70:90] = FacadeClass.WINDOW
    image = np.random.default_rng(0).integers(0, 255, (80, 120, 3), dtype=np.uint8)
    hidden = np.zeros(labels.shape, bool)
    hidden[60:] = True
    np.testing.assert_array_equal(lengthen_doors(image, labels, hidden, MPP)[1], labels)
    labels[76:, 40:110] = FacadeClass.WALL
    labels[20:60, 42:60] = FacadeClass.WINDOW
    _, carried = lengthen_doors(image, labels, hidden, MPP)
    np.testing.assert_array_equal(carried == FacadeClass.WINDOW, labels == FacadeClass.WINDOW)
