"""Levels as the report draws them, and walls that share an exemplar."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.painter.facade import paint_facade
from facade_core.core.errors import InputError
from facade_core.facade.exemplar_facade import ScaledStyle, build_facade_from_exemplar
from facade_core.facade.facade import Facade
from facade_core.facade.texture.retargeting import analyse_exemplar
from facade_core.facade.texture.wall_floors import FacadeWall
from facade_core.facade.variation.encoding import encode
from facade_core.facade.variation.level_drawing import draw_level

PAINTED = paint_facade((13.0, 14.0), floors=4, columns=5, style="brick", metres_per_pixel=0.06, seed=2)


def test_a_level_is_drawn_above_its_types() -> None:
    hierarchy = encode(PAINTED.image, PAINTED.elements)
    last = len(hierarchy.levels) - 1
    height, width = PAINTED.labels.shape
    first, final = draw_level(hierarchy, 0), draw_level(hierarchy, last)
    for level, drawn in ((0, first), (last, final)):
        assert drawn.shape[0] > height
        assert drawn.shape[1] == width
        np.testing.assert_array_equal(drawn[:height], hierarchy.reconstruct(level))
    assert (first[height:] != 255).any(axis=2).sum() > (final[height:] != 255).any(axis=2).sum()
    with pytest.raises(InputError, match="levels 0 to"):
        draw_level(hierarchy, last + 1)


def test_a_bare_wall_is_drawn_without_types() -> None:
    bare = encode(PAINTED.image, [])
    np.testing.assert_array_equal(draw_level(bare, 0), bare.reconstruct(0))


def test_neighbours_that_share_an_exemplar_differ_and_each_repeats_by_its_seed() -> None:
    def wall(seed: int) -> Facade:
        size = PAINTED.labels.shape
        style = analyse_exemplar(PAINTED.image, PAINTED.labels)
        wall_of_style = FacadeWall.freestanding(13.0, 14.0, floors=4)
        return build_facade_from_exemplar(ScaledStyle(style, 0.06), wall_of_style, size, seed=seed)

    one, two = wall(1), wall(2)
    np.testing.assert_array_equal(one.image, wall(1).image)
    apart = np.abs(one.image.astype(int) - two.image)
    windows = [e for e in one.elements if e.label == "window"]
    changed = [apart[int(e.y0) : int(e.y1), int(e.x0) : int(e.x1)].mean() > 8 for e in windows]
    assert np.mean(changed) >= 0.4
