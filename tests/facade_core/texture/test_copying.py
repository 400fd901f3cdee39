from __future__ import annotations

import numpy as np
import pytest

from facade_core.facade.texture.floor_inpainting import _penalise_outliers
from facade_core.facade.texture.gradient_blending import solve_colour_offsets
from facade_core.facade.texture.label_expansion import choose_sources
from facade_core.facade.texture.mosaic import fill_from_chosen_sources
from facade_core.facade.texture.source_costs import UNUSABLE_PRICE, SourceCosts, compute_source_costs
from facade_core.facade.texture.translations import find_repeat_translations


@pytest.fixture
def wallpaper() -> np.ndarray:
    """Noise that repeats every 24 rows and 20 columns: (96, 100, 3) float32, 0-1."""
    return np.tile(np.random.default_rng(5).random((24, 20, 3), np.float32), (4, 5, 1))


@pytest.fixture
def known() -> np.ndarray:
    known = np.ones((96, 100), bool)
    known[30:60, 40:70] = False
    return known


def test_repeats_are_found_down_and_across(wallpaper, known):
    maps = {tuple(m) for m in find_repeat_translations(wallpaper.mean(2) - 0.5, known).tolist()}
    assert {(24, 0, 0), (-24, 0, 0), (0, 20, 0), (0, -20, 0)} <= maps


def test_a_mirror_image_is_found():
    half = np.random.default_rng(2).random((60, 40), np.float32) - 0.5
    image = np.concatenate([half, half[:, ::-1]], 1)
    maps = find_repeat_translations(image, np.ones(image.shape, bool))
    assert (0, 79, 1) in {tuple(m) for m in maps.tolist()}  # x is taken from 79 - x


def test_prices_tell_a_true_repeat_from_a_false_one(wallpaper, known):
    hidden = np.argwhere(~known)
    guide = np.full(known.shape, 255, np.uint8)
    offer = compute_source_costs(
        wallpaper, known, hidden, guide, np.array([[0, -40, 0], [0, -37, 0], [0, 300, 0]]), 4.0
    )
    usable = offer.price[0] < UNUSABLE_PRICE
    assert usable.all()
    compared = offer.price[1] < UNUSABLE_PRICE
    assert offer.price[0][compared].mean() < 0.8 * offer.price[1][compared].mean()
    assert (offer.price[2] == UNUSABLE_PRICE).all()
    np.testing.assert_array_equal(offer.colour[0], wallpaper[~known])


def test_a_plan_makes_what_contradicts_it_dearer(wallpaper, known):
    hidden = np.argwhere(~known)
    guide = np.zeros(known.shape, np.uint8)
    guide[~known] = 1
    maps = np.array([[0, -40, 0]])
    plain = compute_source_costs(wallpaper, known, hidden, np.zeros_like(guide), maps, 4.0).price
    assert (compute_source_costs(wallpaper, known, hidden, guide, maps, 4.0).price > plain + 0.02).all()


def test_choice_is_the_least_energy_of_a_chain():
    rng = np.random.default_rng(0)
    price, colour = rng.random((3, 7)).astype(np.float32), rng.random((3, 7, 3)).astype(np.float32)
    edges = np.stack([np.arange(6), np.arange(1, 7)], 1)

    def energy(labels: np.ndarray) -> float:
        total = float(price[labels, np.arange(7)].sum())
        for p, q in edges:
            a, b = labels[p], labels[q]
            total += 0.3 * float(np.abs(colour[a, [p, q]] - colour[b, [p, q]]).sum())
        return total

    best = min(energy(np.array(np.unravel_index(k, (3,) * 7))) for k in range(3**7))
    found = choose_sources(SourceCosts(price, colour), edges, np.zeros_like(price), 0.3)
    assert energy(found) <= best * 1.02


def test_membrane_takes_a_shade_over_into_the_hole():
    hidden = np.zeros((40, 50), bool)
    hidden[10:30, 10:40] = True
    right, below = np.zeros((40, 50, 3), np.float32), np.zeros((40, 50, 3), np.float32)
    right[10:30, 9], right[10:30, 39] = 0.03, -0.03  # what is around is lighter by this
    below[9, 10:40], below[29, 10:40] = 0.03, -0.03
    offset = solve_colour_offsets(right, below, hidden, hidden.astype(np.int32))
    np.testing.assert_allclose(offset[hidden], 0.03, atol=0.004)
    assert (offset[~hidden] == 0).all()


def test_copies_are_fitted_to_the_pixel_and_known_pixels_stay(wallpaper, known):
    image = np.rint(wallpaper * 255).astype(np.uint8)
    spoiled = np.where(known[..., None], image, 0)
    chosen = np.where(known[::2, ::2], -1, 0)
    out, done = fill_from_chosen_sources(
        spoiled, known, chosen, np.array([[0, -21, 0]]), 2, 4.0
    )  # 42 px; the repeat is at 40
    assert done.all()
    assert np.abs(out.astype(int) - image).max() <= 2


def test_a_map_without_an_offer_is_no_black_picture_to_the_seams() -> None:
    """One of two translations has no source for the right half: their seam costs the difference where both have one."""
    price = np.array([[0.1, 0.1, 0.1, 0.1], [0.2, 0.2, UNUSABLE_PRICE, UNUSABLE_PRICE]], np.float32)
    colour = np.full((2, 4, 3), 0.7, np.float32)
    colour[1, 2:] = 0.0
    agreed = _penalise_outliers(SourceCosts(price, colour))
    np.testing.assert_allclose(agreed.colour[1], 0.7, atol=1e-6)
    assert (agreed.price[1, 2:] == UNUSABLE_PRICE).all()
