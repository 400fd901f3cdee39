"""Panes of windows and shops, and what shops show at night."""

from __future__ import annotations

import numpy as np
import pytest

from facade_core.core.labels import FacadeClass
from facade_core.export.lighting.panes import (
    SeededRandom,
    find_openings,
    glass_mask,
    modulate_by_picture,
    opening_emission,
    snap_to_boxes,
)
from facade_core.export.lighting.shop_interiors import shop_interior_light

DENSITY = 20.0


def shop_front() -> np.ndarray:
    """Three shops 3 m wide, the second of which a parser took for a door here and there, and a door beside."""
    labels = np.full((140, 320), FacadeClass.WALL, np.uint8)
    for left in (20, 100, 180):
        labels[60:138, left : left + 60] = FacadeClass.SHOP
    rng = np.random.default_rng(2)
    labels[60:64, 20:80][:, rng.random(60) < 0.5] = FacadeClass.WALL
    labels[100:138, 120:150] = FacadeClass.DOOR
    labels[60:66, 100:135] = FacadeClass.WINDOW
    labels[70:138, 270:300] = FacadeClass.DOOR
    return labels


def test_a_shop_has_the_box_of_what_hangs_together_whatever_its_rim() -> None:
    found = sorted(find_openings(snap_to_boxes(shop_front())), key=lambda one: one.left)
    assert [one.label for one in found] == [FacadeClass.SHOP] * 3
    assert [(one.left, one.right, one.bottom) for one in found] == [(20, 80, 138), (100, 160, 138), (180, 240, 138)]
    assert all(60 <= one.top <= 64 for one in found)
    for one in found:
        clear = glass_mask(one, np.full((140, 320), 90, np.uint8), DENSITY)
        rows, columns = np.flatnonzero(clear.any(axis=1)), np.flatnonzero(clear.any(axis=0))
        assert clear[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1].all(), "its panes are a rectangle"


def test_what_is_no_shop_is_its_box_and_specks_stay() -> None:
    labels = shop_front()
    labels[20:40, 100:124] = FacadeClass.WINDOW
    labels[20:24, 100:104] = FacadeClass.WALL
    labels[5, 5] = FacadeClass.WINDOW
    found = snap_to_boxes(labels)
    assert (found[20:40, 100:124] == FacadeClass.WINDOW).all()
    assert found[5, 5] == FacadeClass.WINDOW
    assert (found[70:138, 270:300] == FacadeClass.DOOR).all()
    assert (found == snap_to_boxes(found)).all(), "boxes stay"
    assert (1, 5, 5) in {(one.label, one.left, one.top) for one in find_openings(found)}


def test_a_window_that_holds_a_patch_of_shop_stays_a_window() -> None:
    labels = np.full((60, 80), FacadeClass.WALL, np.uint8)
    labels[10:50, 20:60] = FacadeClass.WINDOW
    labels[20:35, 30:44] = FacadeClass.SHOP
    (found,) = find_openings(snap_to_boxes(labels))
    assert (found.label, found.left, found.top, found.right, found.bottom) == (FacadeClass.WINDOW, 20, 10, 60, 50)


def test_shops_are_no_more_than_twice_as_light_as_flats_warm_and_uneven() -> None:
    shops, windows = np.full((80, 64), FacadeClass.WALL, np.uint8), np.full((80, 64), FacadeClass.WALL, np.uint8)
    shops[10:78, 2:62], windows[20:50, 20:44] = FacadeClass.SHOP, FacadeClass.WINDOW
    picture = np.full((80, 64), 80, np.uint8)
    means: dict[int, list[float]] = {FacadeClass.SHOP: [], FacadeClass.WINDOW: []}
    red, blue, uneven = 0.0, 0.0, []
    for labels, kind in ((shops, FacadeClass.SHOP), (windows, FacadeClass.WINDOW)):
        (one,) = find_openings(labels)
        clear = glass_mask(one, picture, DENSITY)
        for building in range(120):
            light = opening_emission(one, DENSITY, 4.0 if kind == FacadeClass.SHOP else 9.0, SeededRandom(building, 1))
            if light is None:
                continue
            shown = modulate_by_picture(one, light, picture, clear)[clear]
            means[kind].append(float(shown.mean()))
            assert shown.max() <= 1.3
            if kind == FacadeClass.SHOP and shown.mean() > 0.08:
                red, blue = red + shown[:, 0].mean(), blue + shown[:, 2].mean()
                uneven.append(float(shown.std() / shown.mean()))
    assert (
        np.mean(means[FacadeClass.WINDOW])
        < np.mean([m for m in means[FacadeClass.SHOP] if m > 0.08])
        < 2 * np.mean(means[FacadeClass.WINDOW])
    )
    assert red > 1.5 * blue
    assert min(uneven) > 0.2, "none is a flat white"


def test_an_interior_is_the_same_at_half_the_texels_darker_below_and_has_goods_on_shelves() -> None:
    random = SeededRandom(5, 6)
    fine, coarse = (
        shop_interior_light((80 * k, 96 * k), 20.0 * k, 0.1, lambda *what: random.per_wall(1, *what)) for k in (2, 1)
    )
    half = fine.reshape(80, 2, 96, 2, 3).mean(axis=(1, 3))
    assert np.abs(half - coarse).mean() < 0.03
    assert fine[20:60].mean() > 1.3 * fine[-20:].mean()
    plain = shop_interior_light((160, 192), 40.0, 0.9, lambda *what: random.per_wall(1, *what))
    assert np.ptp(fine[60:120], axis=1).mean() > 3 * np.ptp(plain[70:105], axis=1).mean(), (
        "goods are many, a wall is one"
    )
    assert fine.mean() == pytest.approx(plain.mean(), rel=0.5)
