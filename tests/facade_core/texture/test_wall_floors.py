"""Floors of walls of any height: none too low or too high, none stretched, and no roof where the model has one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from benchmarks.painter.facade import PaintedFacade, paint_facade
from facade_core.core.labels import FacadeClass
from facade_core.facade.texture.building_walls import compose_wall
from facade_core.facade.texture.retargeting import ExemplarAnalysis, analyse_exemplar, fit_sizes_to_total
from facade_core.facade.texture.roof_removal import cut_off_roof
from facade_core.facade.texture.settings import FLOORS
from facade_core.facade.texture.wall_floors import (
    FacadeWall,
    lattice_rows,
    limit_floor_count,
    shows_ground_floor,
    stack_floors,
)
from facade_core.geometry.settings import FACADE_WALLS
from facade_core.parsing.floor_structure import find_floors_and_bays

MPP = 0.0625


def painted(style: str) -> PaintedFacade:
    return paint_facade((18.0, 14.0), floors=5, columns=5, style=style, metres_per_pixel=MPP, seed=2)


@pytest.fixture(scope="module", params=["haussmann", "brick"])
def style(request: pytest.FixtureRequest) -> ExemplarAnalysis:
    facade = painted(request.param)
    return analyse_exemplar(facade.image, facade.labels)


@pytest.mark.parametrize(
    ("floors", "height", "expected"), [(4, 9.2, 3), (2, 16.0, 4), (3, 9.6, 3), (1, 5.9, 1), (1, 2.5, 1), (2, 10.4, 2)]
)
def test_rows_are_added_or_dropped_for_floors_of_a_floors_height(floors: int, height: float, expected: int) -> None:
    assert limit_floor_count(floors, height) == expected


def test_floors_are_within_limits_and_not_stretched(style: ExemplarAnalysis) -> None:
    pixel_rows = np.asarray(style.grid.rows)
    for eaves in (3.0, 5.0, 7.1, 9.2, 12.0, 16.4):
        for stated in (1, 3, 6):
            for foot, height in ((0.0, eaves), (1.9, eaves - 1.9), (0.0, eaves + 4.0), (0.0, 0.6 * eaves)):
                if height < FACADE_WALLS.floor_height_m[0]:
                    continue
                free = shapely.box(0, 0, 12, height)
                wall = FacadeWall(12, height, foot, eaves, stated, on_street=True, is_back=False, free=free)
                stack, scale = stack_floors(style, wall, MPP)
                assert sum(sum(one.all_heights) for one in stack) == pytest.approx(height)
                for one in stack:
                    rows = lattice_rows(style, one.exemplar_floor)
                    natural = scale * (pixel_rows[rows.stop] - pixel_rows[rows.start])
                    assert sum(one.heights) <= FLOORS.max_floor_stretch * natural + 1e-6
                for one in stack[1:-1]:
                    assert FLOORS.min_floor_m - 1e-6 <= sum(one.all_heights) <= FACADE_WALLS.floor_height_m[1] + 1e-6
                for one in (stack[0], stack[-1]):  # they may join a rest that is too low for a floor
                    assert sum(one.all_heights) >= min(height, FLOORS.min_floor_m) - 1e-6
                    assert (
                        sum(one.all_heights)
                        <= max(FLOORS.max_ground_floor_m, 2 * FACADE_WALLS.floor_height_m[0]) + 1e-6
                    )
                    assert not (one.plinth and shows_ground_floor(style, one)), "doors are at the foot"


@pytest.mark.parametrize("foot", [0.0, 5.3])
def test_a_wall_that_ends_between_the_storeys_of_its_building_has_windows_up_to_its_top(
    style: ExemplarAnalysis, foot: float
) -> None:
    for height in np.arange(5.0, 13.0, 0.3).tolist():
        wall = replace(FacadeWall.freestanding(height, 12.0, 5), foot=foot, eaves=16.0, is_raised=foot > 0)
        stack, _ = stack_floors(style, wall, MPP)
        upper = [sum(one.all_heights) for one in stack if not shows_ground_floor(style, one)]
        assert min(upper) >= FLOORS.min_floor_m - 1e-6
        assert max(upper) <= max(2 * FLOORS.min_floor_m, FLOORS.max_floor_stretch * FACADE_WALLS.floor_height_m[1]), (
            height
        )
        assert all(one.attic + one.plinth < 1.0 for one in stack), height


def test_a_low_building_does_not_enlarge_its_exemplar(style: ExemplarAnalysis) -> None:
    """A shed of one storey has a window and a door of usual size."""
    stack, scale = stack_floors(style, FacadeWall.freestanding(5.0, 12.0, 1), MPP)
    assert len(stack) == 1
    assert scale * float(np.diff(style.structure.floor_cuts).min()) <= FLOORS.max_shown_storey_m + 1e-6


def test_a_lower_wall_ends_in_the_cornice_unless_it_is_a_gable() -> None:
    facade = painted("brick")
    image, labels = cut_off_roof(facade.image, facade.labels)
    style = analyse_exemplar(image, labels)
    level, gable = shapely.box(0, 0, 12, 9.6), shapely.Polygon([(0, 4), (6, 0), (12, 4), (12, 9.6), (0, 9.6)])
    for free, crowned in ((level, True), (gable, False)):
        wall = FacadeWall(12, 9.6, 0.0, 12.8, 4, on_street=True, is_back=False, free=free)
        top = stack_floors(style, wall, MPP)[0][0]
        assert top.is_crowned == crowned
        assert not crowned or top.exemplar_floor == 0


@pytest.mark.parametrize(("eaves", "floors"), [(12.8, 4), (16.0, 4), (19.2, 6)])
def test_storeys_are_those_of_the_wall_at_any_scale_of_the_exemplar(
    style: ExemplarAnalysis, eaves: float, floors: int
) -> None:
    """The scale of an unposed picture assumes a height of storeys; an exemplar gives their ratios."""
    wall = FacadeWall.freestanding(eaves, 15.0, floors)
    (stack, scale), (other_stack, other_scale) = (stack_floors(style, wall, factor * MPP) for factor in (1.0, 1.25))
    assert other_scale == pytest.approx(scale, rel=0.01)
    heights, others = ([sum(one.all_heights) for one in each] for each in (stack, other_stack))
    assert others == pytest.approx(heights, abs=0.03)
    assert max(heights) - min(heights) > 0.2


def test_bare_wall_takes_what_no_floor_can(style: ExemplarAnalysis) -> None:
    """A high wall of one storey."""
    wall = FacadeWall.freestanding(5.9, 12.0, 1)
    stack, _ = stack_floors(style, wall, MPP)
    assert stack[0].attic > 0.5
    labels = compose_wall(style, wall, metres_per_pixel=MPP)[1]
    assert (labels[: round(0.8 * stack[0].attic / MPP)] == FacadeClass.WALL).mean() > 0.95


@pytest.mark.parametrize("total", [3.1, 4.4, 10.0, 14.0])
def test_windows_keep_their_width_where_piers_have_room(total: float) -> None:
    sizes, soft = np.array([1.0, 1.6, 1.0, 1.0, 1.6, 1.0]), np.array([True, False, True] * 2)
    fitted = fit_sizes_to_total(sizes, soft, total)
    assert fitted.sum() == pytest.approx(total)
    assert (np.abs(np.log(fitted[~soft] / sizes[~soft])) <= np.log(1 / 0.9) + 1e-6).all()


@pytest.mark.parametrize("name", ["haussmann", "jugend"])
def test_a_wall_under_a_roof_of_the_model_ends_with_its_cornice(name: str) -> None:
    facade = painted(name)
    assert (facade.labels == FacadeClass.ROOF).any()
    image, labels = cut_off_roof(facade.image, facade.labels)
    assert image.shape[:2] == labels.shape
    np.testing.assert_array_equal(image, facade.image[-len(image) :])
    assert (labels[0] == FacadeClass.WALL).mean() > 0.5
    assert (labels == FacadeClass.ROOF).mean() < 0.002
    assert len(labels) > 0.6 * len(facade.labels)
    wall = FacadeWall.freestanding(16.0, 12.0, floors=5)
    style = analyse_exemplar(image, labels)
    made = compose_wall(style, wall, metres_per_pixel=MPP)[1]
    assert not ((made == FacadeClass.ROOF).mean(axis=1) > 0.2).any()
    assert stack_floors(style, wall, MPP)[0][0].is_crowned


@pytest.mark.parametrize("floors", [2, 5])
@pytest.mark.parametrize("colour", [(120, 50, 40), (60, 60, 65), (120, 170, 230)])
def test_a_roof_or_sky_labelled_as_wall_is_cut_off(colour: tuple[int, int, int], floors: int) -> None:
    facade = paint_facade((3.6 * floors, 14.0), floors=floors, columns=5, style="brick", metres_per_pixel=MPP, seed=2)
    rows, width = 30, facade.labels.shape[1]
    image = np.concatenate([np.full((rows, width, 3), colour, np.uint8), facade.image])
    labels = np.concatenate([np.full((rows, width), FacadeClass.WALL, np.uint8), facade.labels])
    kept = cut_off_roof(image, labels)[0]
    own = 2 if floors > 2 else 10  # over a single upper floor the dark cornice goes too
    assert rows - 2 <= len(image) - len(kept) <= rows + own


def test_a_storey_in_the_sun_above_a_wall_in_shade_stays() -> None:
    facade = painted("brick")
    image = facade.image.copy()
    image[len(image) // 2 :] //= 2
    assert cut_off_roof(image, facade.labels)[1] is facade.labels


def test_a_storey_of_another_colour_stays() -> None:
    facade = painted("brick")
    found = find_floors_and_bays(facade.labels)
    assert found is not None
    top, bottom = found.floors[0]
    image = facade.image.copy()
    image[:bottom][facade.labels[:bottom] == FacadeClass.WALL] = (60, 60, 65)
    kept = cut_off_roof(image, facade.labels)[1]
    assert len(facade.labels) - len(kept) <= top


def test_an_exemplar_without_a_roof_stays_as_it_is() -> None:
    facade = painted("brick")
    assert cut_off_roof(facade.image, facade.labels)[1] is facade.labels
