"""Exemplars are chosen by fit and by street, never twice within sight, and by what is near alone."""

from __future__ import annotations

from dataclasses import fields, replace

import cv2
import numpy as np

from benchmarks.painter.facade import paint_facade
from facade_core.core.facade_styles import OTHER_STYLE
from facade_core.core.labels import FacadeClass
from facade_core.facade.texture.ground_floor import (
    replace_ground_floor_by_windows,
    transplant_ground_floor,
)
from facade_core.facade.texture.tint import tint_facade
from facade_core.parsing.floor_structure import find_floors_and_bays
from facade_core.plan.exemplar_choice import (
    ExemplarTargetWalls,
    choose_exemplars,
    choose_ground_floors,
    exemplar_choice_order,
)
from facade_core.plan.exemplar_style import ExemplarLibrary, style_descriptor
from facade_core.plan.settings import EXEMPLAR_CHOICE

# A house every 20 m on both sides of a street 18 m wide.
STEP, ACROSS = 20.0, 18.0


def row(count: int, *, street: int = 1, start: float = 0.0, number: int = 0) -> ExemplarTargetWalls:
    west = start + STEP * (np.arange(count) // 2)
    side = ACROSS * (np.arange(count) % 2)
    ends = np.stack([np.stack([west, side], 1), np.stack([west + STEP, side], 1)], 1)
    whole = np.full(count, 1)
    return ExemplarTargetWalls(
        20.0 * whole, 18.0 * whole, 5 * whole, number + np.arange(count), street * whole, ends, -whole, 0 * whole
    )


def joined(*parts: ExemplarTargetWalls) -> ExemplarTargetWalls:
    return ExemplarTargetWalls(
        *(np.concatenate([getattr(part, name) for part in parts]) for name in ExemplarTargetWalls.__dataclass_fields__)
    )


def library(count: int, families: int = 1) -> ExemplarLibrary:
    looks = np.zeros((count, 9))
    looks[:, 0] = 60.0 * (np.arange(count) % families)
    looks[:, 1] = 2.0 * (np.arange(count) // families)
    return ExemplarLibrary(
        [18.0] * count,
        [5.0] * count,
        [0.0] * count,
        [0.0] * count,
        [1.0] * count,
        [1.0] * count,
        looks.tolist(),
    )


def gap(walls: ExemplarTargetWalls, chosen: np.ndarray) -> float:
    """The least distance, metres, between two buildings of one exemplar."""
    middle = walls.ends.mean(axis=1)
    apart = np.linalg.norm(middle[:, None] - middle[None], axis=-1)
    same = (chosen[:, None] == chosen[None]) & (walls.building[:, None] != walls.building[None])
    return float(apart[same].min(initial=np.inf))


def test_no_two_neighbours_take_one_exemplar() -> None:
    walls = row(60)
    chosen = choose_exemplars(walls, library(16), seed=3)
    assert gap(walls, chosen) > EXEMPLAR_CHOICE.neighbourhood_m
    used = np.bincount(chosen, minlength=16)
    assert used.min() >= 1, "every exemplar is used"
    assert used.max() <= 8


def test_with_fewer_exemplars_than_neighbours_the_farthest_is_repeated() -> None:
    chosen = choose_exemplars(row(40), library(4), seed=3)
    assert (chosen[2:] != chosen[:-2]).all(), "no two houses side by side are twins"


def test_facades_of_one_building_share_and_size_decides() -> None:
    walls = row(3)
    walls = replace(walls, building=np.array([3, 3, 4]), floors=np.array([6, 6, 2]), width=np.array([20.0, 8.0, 20.0]))
    sizes = replace(library(2), floors=[6.0, 1.0])
    chosen = choose_exemplars(walls, sizes, seed=1)
    assert chosen.tolist() == [0, 0, 1]
    wide = replace(walls, width=np.array([90.0, 8.0, 90.0]))
    assert choose_exemplars(wide, sizes, seed=1).tolist() == chosen.tolist(), "any width is made"


def test_a_bad_exemplar_is_left_out_even_among_neighbours() -> None:
    """Thirty houses within sight of each other, six exemplars, one of them bad."""
    crowd = replace(row(30), ends=row(30).ends / 16)
    body = [1.0, 1.0, EXEMPLAR_CHOICE.min_body - 0.1, 1.0, 1.0, 1.0]
    assert 2 in choose_exemplars(crowd, library(6), seed=1)
    assert 2 not in choose_exemplars(crowd, replace(library(6), body=body), seed=1)
    all_bad = replace(library(2), body=[0.05, 0.2])
    assert set(choose_exemplars(crowd, all_bad, seed=1)) == {1}, "the best of bad ones"


def test_a_poor_exemplar_is_shown_less_than_a_good_one_is_repeated() -> None:
    """Quality beats variety: of six exemplars within sight of each other three are poor."""
    crowd = replace(row(30), ends=row(30).ends / 16)
    body = [1.0, 0.5, 1.0, 0.5, 1.0, 0.5]
    used = np.bincount(choose_exemplars(crowd, replace(library(6), body=body), seed=1), minlength=6)
    assert used[1::2].sum() < 0.2 * used.sum()


def test_a_building_takes_a_shipped_exemplar_of_its_own_style() -> None:
    walls = replace(row(12), style=np.arange(12) % 2)
    shipped = replace(library(6), style=[0, 0, 0, 1, 1, 2], floors=[5.0, 5.0, 5.0, 1.0, 1.0, 5.0])
    chosen = choose_exemplars(walls, shipped, seed=1)
    assert np.array_equal(np.array(shipped.style)[chosen], walls.style), "in spite of its floors and its neighbours"
    own = replace(library(6), style=[OTHER_STYLE] * 6)
    assert np.array_equal(choose_exemplars(walls, own, seed=1), choose_exemplars(row(12), library(6), seed=1))
    mixed = replace(library(6), style=[OTHER_STYLE, 2, 2, 2, 2, 2])
    assert set(choose_exemplars(walls, mixed, seed=1)) == {0}, "an own picture before a shipped one of another style"


def test_a_shipped_exemplar_takes_no_ground_floor_of_another_style() -> None:
    shipped = replace(library(2), style=[0, 1], foot=[0.3, 1.0])
    assert ground_floors(shipped, [0]) == [-1]
    assert ground_floors(replace(shipped, style=[0, 0]), [0]) == [1]
    assert ground_floors(replace(shipped, style=[OTHER_STYLE, 1]), [0]) == [1]


def ground_floors(styles: ExemplarLibrary, chosen: list[int], width: float = 20.0, shops: int = -1) -> list[int]:
    whole = np.ones(len(chosen))
    return choose_ground_floors(
        styles,
        np.array(chosen),
        building=np.arange(len(chosen)),
        width=width * whole,
        shops=(shops * whole).astype(np.int64),
        seed=3,
    ).tolist()


def test_a_hidden_ground_floor_is_replaced_by_a_like_one_else_by_a_plain_one() -> None:
    """Exemplars 0 and 1 are of one family, 2 and 3 of the other."""
    styles = replace(library(4), descriptors=[[0.0] * 9, [1.0] + [0.0] * 8, [60.0] + [0.0] * 8, [61.0] + [0.0] * 8])
    assert ground_floors(replace(styles, foot=[0.3, 0.95, 0.95, 0.4]), [0, 1, 2, 3]) == [1, 1, 2, 2]
    assert ground_floors(replace(styles, foot=[0.3, 0.2, 0.1, 0.4]), [0, 1, 2, 3]) == [-1] * 4
    assert ground_floors(replace(styles, foot=[0.3, 0.9, 0.1, 0.4]), [2, 3]) == [-1] * 2, "the other style"


def test_a_ground_floor_fits_the_wall_and_has_the_shops_of_the_map() -> None:
    looks = [[0.0] * 9, [6.0] + [0.0] * 8]
    styles = replace(library(2), fronts=[11.0, 4.0], shops=[0.9, 0.0], descriptors=looks)
    assert ground_floors(styles, [0], width=12.0) == [0]
    assert ground_floors(styles, [0], width=6.0) == [1], "its shop is wider than the wall"
    assert ground_floors(styles, [0], width=12.0, shops=0) == [1]
    assert ground_floors(styles, [1], width=12.0, shops=1) == [0]


def test_all_of_a_crowd_choose_one_after_the_other() -> None:
    """Forty houses within sight of each other and twelve exemplars."""
    chosen = choose_exemplars(replace(row(40), ends=row(40).ends / 16), library(12), seed=3)
    assert np.bincount(chosen, minlength=12).max() <= 6


def test_shops_are_where_the_map_has_them() -> None:
    walls, shops = row(30), np.arange(30) % 3 // 2
    half = replace(library(32), shops=[0.0, 0.7] * 16)
    chosen = choose_exemplars(walls, half, seed=4)
    ground = choose_ground_floors(half, chosen, building=walls.building, width=walls.width, shops=shops, seed=4)
    assert not (ground[shops == 0] % 2 == 1)[ground[shops == 0] >= 0].any()
    assert (ground[shops == 1] % 2 == 1).mean() > 0.9


def test_a_jog_or_a_part_without_shops_does_not_take_the_shops_of_a_building() -> None:
    styles = replace(library(2), shops=[0.8, 0.8], fronts=[2.5, 2.5])
    for width, shops in (([12.0, 1.9], [1, 1]), ([1.9, 12.0], [1, 1]), ([12.0, 12.0], [0, 1]), ([12.0, 12.0], [1, 0])):
        ground = choose_ground_floors(
            styles,
            np.zeros(2, np.int64),
            building=np.ones(2, int),
            width=np.array(width),
            shops=np.array(shops),
            seed=3,
        )
        assert (ground >= 0).all()


def test_the_ground_floor_of_another_exemplar_fits_bays_light_and_scale() -> None:
    own = paint_facade((16.0, 15.0), floors=4, columns=5, style="jugend", metres_per_pixel=0.05, seed=6)
    other = paint_facade((16.0, 9.0), floors=4, columns=3, style="art-deco", metres_per_pixel=0.04, seed=7)
    top, theirs = (find_floors_and_bays(each.labels).ground_top for each in (own, other))
    dark = (own.image * 0.6).astype(np.uint8)
    image, labels = transplant_ground_floor(dark, own.labels, other.image, other.labels, (0.05, 0.04))
    height = round((len(other.labels) - theirs) * 0.8)
    assert labels.shape == image.shape[:2] == (top + height, own.labels.shape[1])
    np.testing.assert_array_equal(image[:top], dark[:top])
    ground, shown = labels[top:], np.unique(labels[top:])
    assert set(shown) <= set(np.unique(other.labels[theirs:]))
    assert (ground == FacadeClass.SHOP).any(), "no shop was cut off"
    lit, _ = transplant_ground_floor(own.image, own.labels, other.image, other.labels, (0.05, 0.04))
    assert abs(image[top:].mean() / lit[top:].mean() - 0.6) < 0.05, "in the light of its own wall"
    sources = [each.bays for each in (find_floors_and_bays(labels), find_floors_and_bays(own.labels))]
    assert sources[0] == sources[1], "bays stay"


def test_a_plain_ground_floor_has_windows_and_a_door_and_no_smear() -> None:
    painted = paint_facade((16.0, 15.0), floors=4, columns=5, style="art-deco", metres_per_pixel=0.05, seed=6)
    top = find_floors_and_bays(painted.labels).ground_top
    smeared = painted.image.copy()
    smeared[top:] = (255, 0, 255)
    image, labels = replace_ground_floor_by_windows(smeared, painted.labels, 0.05)
    np.testing.assert_array_equal(image[:top], smeared[:top])
    assert not (image[top:] == (255, 0, 255)).all(axis=2).any()
    assert not (labels[top:] == FacadeClass.SHOP).any()
    assert cv2.connectedComponents((labels[top:] == FacadeClass.DOOR).astype(np.uint8))[0] == 2, "one door"
    assert (labels[-1] == FacadeClass.DOOR).any(), "which reaches the ground"


def test_a_picture_without_its_ground_floor_gets_one_with_a_door() -> None:
    """The picture ends below the windows of an upper floor."""
    painted = paint_facade((16.0, 15.0), floors=4, columns=5, style="jugend", metres_per_pixel=0.05, seed=6)
    found = find_floors_and_bays(painted.labels)
    rows = slice(0, found.ground_top)
    image, labels = replace_ground_floor_by_windows(painted.image[rows], painted.labels[rows], 0.05)
    lowest = slice(found.floor_cuts[-3], found.ground_top)
    door = np.flatnonzero(labels[-1] == FacadeClass.DOOR)
    head = labels[: np.flatnonzero((labels == FacadeClass.DOOR).any(axis=1))[0], door]
    assert (head[-1] == FacadeClass.WINDOW).mean() > 0.5, "in the opening of a window, whose head stays above it"
    assert len(door) * 0.05 >= 0.8
    assert not (labels[: lowest.start] == FacadeClass.DOOR).any(), "no door above the ground"
    assert find_floors_and_bays(labels).kinds[-1] == "ground"
    np.testing.assert_array_equal(image[: lowest.start], painted.image[: lowest.start])
    alone = np.zeros((60, 160), np.uint8)
    alone[10:30, 40:60] = alone[10:30, 100:120] = FacadeClass.WINDOW
    grey = np.full((60, 160, 3), 128, np.uint8)
    _, two = replace_ground_floor_by_windows(grey, alone, 0.05)
    only = find_floors_and_bays(alone).ground_top
    np.testing.assert_array_equal(two[:only], alone[:only], "the only floor stays above it")
    assert (two[-1] == FacadeClass.DOOR).any()


def test_a_balustrade_above_the_windows_leaves_the_foot_as_it_is() -> None:
    labels = np.zeros((69, 120), np.uint8)
    labels[5:12, 20:36] = labels[15:20] = FacadeClass.BALCONY
    labels[24:44, 20:40] = labels[24:44, 70:90] = FacadeClass.WINDOW
    image = np.full((69, 120, 3), 128, np.uint8)
    assert (replace_ground_floor_by_windows(image, labels, 0.05)[1][-1] == FacadeClass.DOOR).any()


def test_walls_of_one_exemplar_differ_by_house() -> None:
    painted = paint_facade((16.0, 15.0), floors=4, columns=5, style="jugend", metres_per_pixel=0.05, seed=6)
    wall, window = painted.labels == FacadeClass.WALL, painted.labels == FacadeClass.WINDOW
    one, same, other = (
        tint_facade(painted.image, painted.labels, building_seed=h, seed=s).astype(float)
        for h, s in ((1, 1), (1, 2), (2, 1))
    )
    inner = np.s_[60:-60]
    assert np.abs(one - same)[inner][wall[inner]].mean() < 0.5, "the facades of a house share their paint"
    assert np.abs(one - same)[window].mean() > 1.5, "their panes do not mirror alike"
    assert np.abs(one - other)[wall].mean() > 1
    assert np.abs(np.log(one[wall].mean() / painted.image[wall].mean())) < 0.15, "within what paint does"
    np.testing.assert_array_equal(one, tint_facade(painted.image, painted.labels, building_seed=1, seed=1))


def test_a_street_keeps_a_character_and_another_has_its_own() -> None:
    many = library(48, families=8)
    apart = [row(30, street=number, start=5000.0 * number, number=100 * number) for number in range(1, 9)]
    families = [np.bincount(many.family[choose_exemplars(street, many, seed=2)], minlength=8) for street in apart]
    for own in families:
        assert np.sort(own)[-3:].sum() >= 0.9 * own.sum(), "two or three families make a street"
    assert len({tuple(np.flatnonzero(own >= 3)) for own in families}) >= 4


def test_families_keep_their_shares_of_a_city() -> None:
    """Three of four exemplars are of one style; the others are unlike it and unlike each other."""
    many = library(40)
    spread = np.array([5, 2, 3, 0.04, 0.12, 0.1, 0.02, 0.04, 1.0])  # half of a visible difference
    looks = np.random.default_rng(1).normal(0, spread, (40, 9))
    looks[30:, 0] += 60.0 * np.arange(1, 11)
    many = replace(many, descriptors=looks.tolist())
    city = joined(*(row(24, street=number, start=5000.0 * number, number=100 * number) for number in range(1, 13)))
    usual = np.mean([(choose_exemplars(city, many, seed=seed) < 30).mean() for seed in range(5)])
    assert abs(usual - 0.75) <= 0.1


def test_what_is_far_away_changes_nothing() -> None:
    here = row(40)
    far = row(20, start=2 * EXEMPLAR_CHOICE.neighbourhood_m + 40 * STEP, number=500)
    alone = choose_exemplars(here, library(20), seed=5)
    np.testing.assert_array_equal(choose_exemplars(joined(here, far), library(20), seed=5)[:40], alone)
    turned = ExemplarTargetWalls(*(getattr(here, name)[::-1] for name in ExemplarTargetWalls.__dataclass_fields__))
    np.testing.assert_array_equal(choose_exemplars(turned, library(20), seed=5)[::-1], alone)


def test_a_house_that_comes_changes_few_beside_it() -> None:
    here, new = row(200), row(1, start=-STEP, number=900)
    before = choose_exemplars(here, library(20), seed=5)
    after = choose_exemplars(joined(here, new), library(20), seed=5)[:200]
    changed = np.flatnonzero(before != after)
    assert len(changed) <= 12
    assert (here.ends[changed, 0, 0] < 600).all()


def test_a_choice_depends_on_the_buildings_that_the_order_names() -> None:
    here = row(40)
    chosen = choose_exemplars(here, library(20), seed=5)
    order = exemplar_choice_order(here, seed=5)
    for i in range(0, 40, 5):
        kept = np.isin(here.building, order.dependencies(here.building[i : i + 1]))
        fewer = ExemplarTargetWalls(**{field.name: getattr(here, field.name)[kept] for field in fields(here)})
        assert choose_exemplars(fewer, library(20), seed=5)[kept[:i].sum()] == chosen[i]
        assert not kept.all()


def test_looks_tell_walls_apart() -> None:
    def of(style: str, seed: int) -> np.ndarray:
        painted = paint_facade((15.0, 14.0), floors=4, columns=4, style=style, metres_per_pixel=0.08, seed=seed)
        return np.array([style_descriptor(painted.image, painted.labels, 0.08)])

    brick, again, functionalist = of("brick", 1), of("brick", 2), of("functionalist", 1)
    three = ExemplarLibrary(
        [1] * 3,
        [1] * 3,
        [0] * 3,
        [0] * 3,
        [1] * 3,
        [1] * 3,
        np.concatenate([brick, again, functionalist]).tolist(),
    )
    assert three.distance[0, 1] < three.distance[0, 2]
    assert three.distance[0, 2] > 1


def test_neighbours_do_not_differ_in_paint_alone() -> None:
    many = library(24)
    looks = np.zeros((24, 9))
    looks[:, 1] = 8.0 * np.arange(24)  # colours far apart, and forms of four kinds
    looks[:, 3] = 0.2 * (np.arange(24) % 4)
    two = row(2)
    for seed in range(12):
        one, other = choose_exemplars(two, replace(many, descriptors=looks.tolist()), seed=seed) % 4
        assert one != other
