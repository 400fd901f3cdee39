"""Ground floors of street walls: no shop is cut, doors are where the map has them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from benchmarks.painter.facade import paint_facade
from facade_core.core.labels import FacadeClass
from facade_core.facade.texture.building_walls import compose_wall
from facade_core.facade.texture.ground_units import arrange_units, find_ground_units
from facade_core.facade.texture.retargeting import ExemplarAnalysis, analyse_exemplar
from facade_core.facade.texture.settings import GROUND_FLOOR
from facade_core.facade.texture.wall_floors import FacadeWall

MPP = 0.08


@pytest.fixture(scope="module")
def style(facade) -> ExemplarAnalysis:
    """One door, and one shop below three of four columns of windows."""
    return analyse_exemplar(facade.image, facade.labels)


def widths(labels: np.ndarray, label: FacadeClass) -> list[float]:
    parts, _ = ndimage.label(labels == label)
    return [(box[1].stop - box[1].start) * MPP for box in ndimage.find_objects(parts)]


@pytest.mark.parametrize("width", [8.0, 11.5, 14.0, 21.0, 26.0])
def test_no_shop_and_no_door_is_cut(style: ExemplarAnalysis, width: float) -> None:
    labels = compose_wall(style, FacadeWall.freestanding(18.0, width, 5), metres_per_pixel=MPP)[1]
    for label in (FacadeClass.SHOP, FacadeClass.DOOR):
        (natural,) = widths(style.labels, label)
        shown = widths(labels, label)
        assert shown or width < 11, "a wall as narrow as the shop has no door"
        for one in shown:
            assert (
                GROUND_FLOOR.element_stretch[0] * 0.97 - MPP
                < one / natural
                < GROUND_FLOOR.element_stretch[1] * 1.03 + MPP
            )


def test_a_wall_on_which_no_unit_fits_is_left_to_its_bays(style: ExemplarAnalysis) -> None:
    units = find_ground_units(style.image[-40:, 40:], style.labels[-40:, 40:], MPP)
    assert units is not None
    assert len(units.has_door) == 1
    assert arrange_units(units, 4.0, MPP, np.random.default_rng(0)) is None


def test_a_door_is_shown_where_the_map_has_one() -> None:
    painted = paint_facade((16.2, 14.0), floors=5, columns=5, style="haussmann", metres_per_pixel=MPP, seed=2)
    units = find_ground_units(painted.image[-44:], painted.labels[-44:], MPP)
    assert units is not None
    for place in (3.0, 15.0, 28.0):
        arranged = arrange_units(units, 30.0, MPP, np.random.default_rng(1), (place,))
        assert arranged is not None
        chosen, across = arranged
        assert across[-1] == pytest.approx(30.0)
        assert units.has_door[chosen].any()
        own = int(np.searchsorted(across[3::3], place))
        assert units.has_entrance[chosen[max(0, own - 1) : own + 2]].any()


def test_windows_of_a_ground_floor_without_shops_stay_below_the_others(style: ExemplarAnalysis) -> None:
    plain = replace(
        style, labels=np.where(style.labels == FacadeClass.SHOP, FacadeClass.WALL, style.labels).astype(np.uint8)
    )
    wall = FacadeWall.freestanding(18.0, 12.0, 5)
    labels = compose_wall(plain, wall, metres_per_pixel=MPP)[1]
    assert not (labels == FacadeClass.SHOP).any()
    assert (labels == FacadeClass.DOOR).any()
