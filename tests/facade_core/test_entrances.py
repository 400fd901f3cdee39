"""A narrow corner between two fronts shows their shop; of a building's backs one has a plain door."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from scipy import ndimage

from facade_core.entries import has_back_door, turns_corner
from facade_core.geometry.walls import BACK
from facade_core.ingest import ingest
from facade_core.labels import DOOR, SHOP, WINDOW
from facade_core.plan import Plan
from facade_core.synth import facade as paint
from facade_core.texture import Style, Wall, on_wall, style_of, without_shops
from facade_core.types import Building, Street
from facade_core.walls import wall_of

MPP = 0.05
# One corner cut off at the crossing, and a nook with a narrow wall across it at the other end.
CORNER = shapely.Polygon([(0, 1.5), (1.5, 0), (18, 0), (18, 12), (12, 12), (12, 14), (0, 14)])
NOOK = shapely.Polygon([(24, 0), (30, 0), (30, 4), (31.5, 5.5), (36, 5.5), (36, 14), (24, 14)])


@pytest.fixture(scope="module")
def plan() -> Plan:
    return plan_of([Building("corner", CORNER, 12.8, "height"), Building("nook", NOOK, 12.8, "height")])


def plan_of(buildings: list[Building]) -> Plan:
    return ingest(
        buildings,
        [
            Street("a", "a", shapely.LineString([(-30, -8), (60, -8)])),
            Street("b", "b", shapely.LineString([(-8, -30), (-8, 12)])),
        ],
        texels_per_metre=8.0,
        spacing=6.0,
        height=2.5,
        visibility_range=40.0,
        panorama_width=128,
        storey=3.2,
        walls="exemplar",
        page=512,
    )


@pytest.fixture(scope="module")
def style() -> Style:
    painted = paint((16.2, 14.0), floors=5, columns=5, style="brick", metres_per_pixel=MPP, seed=2)
    assert (painted.labels == SHOP).any()
    return style_of(painted.image, painted.labels)


def test_a_corner_cut_off_between_two_fronts_is_one_and_a_nook_is_none(plan: Plan) -> None:
    facades = plan.facades
    found = [i for i in range(len(facades)) if turns_corner(plan.scene.charts, facades, i)]
    assert [facades.id[i].split("-")[0] for i in found] == ["corner"]
    assert facades.width[found[0]] == pytest.approx(np.hypot(1.5, 1.5), abs=0.01)
    assert wall_of(plan.scene, facades, found[0]).corner


def test_a_corner_in_two_pieces_is_one() -> None:
    pieces = shapely.Polygon([(0, 1.9), (0.75, 0.75), (1.9, 0), (18, 0), (18, 12), (0, 12)])
    facades = (plan := plan_of([Building("corner", pieces, 12.8, "height")])).facades
    found = [i for i in range(len(facades)) if turns_corner(plan.scene.charts, facades, i)]
    assert len(found) == 2
    assert len(set(facades.run[found].tolist())) == 1


def test_every_building_has_a_back_with_a_door(plan: Plan, style: Style) -> None:
    facades = plan.facades
    for name in ("corner", "nook"):
        own = [i for i, id in enumerate(facades.id) if id.startswith(name)]
        doors = [i for i in own if has_back_door(facades, i)]
        backs = [i for i in own if facades.role[i] == BACK]
        assert len(doors) == (2 if len(backs) >= 5 else 1)
        assert facades.width[doors].max() == facades.width[backs].max()
        labels = on_wall(style, wall_of(plan.scene, facades, doors[0]), metres_per_pixel=MPP, seed=3)[1]
        assert ndimage.label(labels == DOOR)[1] == 1
        assert (labels[-1] == DOOR).any()
        assert not (labels == SHOP).any()


def corner(width: float) -> Wall:
    free = shapely.box(0, 0, width, 16)
    return Wall(width, 16, 0, 16, 5, street=False, plain=False, free=free, corner=True)


@pytest.mark.parametrize("width", [1.3, 2.1, 2.9])
def test_a_corner_shows_the_shop_of_its_building_and_no_storey_moves(style: Style, width: float) -> None:
    image, labels = on_wall(style, corner(width), metres_per_pixel=MPP)
    shop = np.flatnonzero((labels == SHOP).any(axis=1))
    assert len(shop)
    assert shop.min() * MPP > 16 - 4.6, "at the ground alone"
    assert not np.isin(labels[:, [0, -1]], (SHOP, DOOR, WINDOW)).any(), "nothing is cut at its edges"
    plain = style_of(*without_shops(style.image, style.labels))
    bare_image, bare = on_wall(plain, corner(width), like=style, metres_per_pixel=MPP)
    assert not np.isin(bare, (SHOP, DOOR)).any()
    assert image.shape == bare_image.shape


def test_what_is_too_narrow_for_a_shop_has_none(style: Style) -> None:
    assert not np.isin(on_wall(style, corner(0.9), metres_per_pixel=MPP)[1], (SHOP, DOOR)).any()


def test_a_back_that_is_covered_at_the_ground_has_no_door(style: Style) -> None:
    wall = Wall(8, 16, 0, 16, 5, street=False, plain=True, free=shapely.box(0, 0, 8, 10), door=True)
    assert not (on_wall(style, wall, metres_per_pixel=MPP)[1] == DOOR).any()
