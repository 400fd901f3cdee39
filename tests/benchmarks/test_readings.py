"""Every reading of Eq. 1 against its formula, and the pinned one against what textures streets."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest

from benchmarks.street.readings import Reading, View, blended
from facade_core.street.propagation.blend import BlendState, blend_views
from tests.facade_core.street.added_views import add_views

TEXELS = 40


def some_views(count: int, seed: int) -> list[View]:
    rng = np.random.default_rng(seed)
    views = []
    for number in range(count):
        texel = np.flatnonzero(rng.random(TEXELS) < 0.6)
        d = rng.integers(0, 15_000, len(texel))
        rgb = rng.integers(0, 256, (len(texel), 3)).astype(np.uint8)
        views.append(View(number, texel, d, d <= 7500, rgb, rng.integers(1, 256, len(texel))))
    return views


@pytest.mark.parametrize("count", [1, 2, 3, 9])
def test_the_pinned_reading_is_that_of_the_street_stage(count: int) -> None:
    views, state = some_views(count, seed=count), BlendState.allocate(TEXELS)
    for view in views:
        add_views(state, view.texel, view.distance, view.proper, np.full(len(view.texel), view.id), view.rgb)
    expected, number = blend_views(state)
    colour, counted = blended(views[::-1], TEXELS, Reading())
    np.testing.assert_array_equal(counted, number)
    assert np.abs(colour.astype(int) - expected).max() <= 1  # a half may be rounded either way
    assert (colour == expected).mean() > 0.98


@pytest.mark.parametrize("clamp", ["mapped", "sum", "none"])
@pytest.mark.parametrize("resolution", [False, True])
def test_every_reading_is_its_formula(clamp: Literal["mapped", "sum", "none"], resolution: bool) -> None:
    views = some_views(6, seed=3)
    colour, counted = blended(views, TEXELS, Reading(gated=False, clamp=clamp, resolution=resolution))
    for texel in range(TEXELS):
        own = [(v.distance[at], v.rgb[at], v.quality[at]) for v in views for at in np.flatnonzero(v.texel == texel)]
        assert counted[texel] == len(own)
        if not own:
            assert not colour[texel].any()
            continue
        d, rgb, quality = (np.array(column, float) for column in zip(*own, strict=True))
        weight = np.ones(len(d))
        if len(d) > 1 and clamp != "none":
            weight = np.clip(1 - d / d.sum(), 0.3, 0.7)
            weight = (weight - 0.3) / 0.4 if clamp == "mapped" else weight
        weight = weight * quality if resolution else weight
        expected = (weight[:, None] * rgb).sum(axis=0) / weight.sum()
        assert np.abs(colour[texel] - expected).max() <= 0.5 + 1e-6
