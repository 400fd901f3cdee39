"""The share of a wall that lies in shadow."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.painter.facade import paint_facade as paint
from facade_core.core.labels import FacadeClass
from facade_core.imagery.rectify.shadow import shadow_share

PAINTED = paint((13.0, 14.0), floors=4, columns=4, style="brick", metres_per_pixel=0.04, seed=2)


def shadowed(part: np.ndarray, left: float = 0.4) -> np.ndarray:
    image = PAINTED.image.copy()
    image[part] = np.rint(left * image[part]).astype(np.uint8)
    return image


def test_a_wall_lit_alike_has_no_shadow() -> None:
    assert shadow_share(PAINTED.image, PAINTED.labels) < 0.1
    dim = shadowed(np.ones(PAINTED.labels.shape, bool))
    assert shadow_share(dim, PAINTED.labels) < 0.1, "all in the shade"


@pytest.mark.parametrize("share", [0.4, 0.5])
def test_a_slanting_shadow_is_measured(share: float) -> None:
    height, width = PAINTED.labels.shape
    y, x = np.mgrid[0:height, 0:width]
    part = y > height * (1 - share) + 0.2 * (x - width / 2)
    true = (part & (PAINTED.labels == FacadeClass.WALL)).sum() / (PAINTED.labels == FacadeClass.WALL).sum()
    assert shadow_share(shadowed(part), PAINTED.labels) == pytest.approx(true, abs=0.08)
    assert shadow_share(shadowed(part, left=0.85), PAINTED.labels) < 0.1, "hardly darker"


def test_shade_under_balconies_is_no_shadow_of_a_building() -> None:
    height = len(PAINTED.labels)
    below_balcony = (np.arange(height) % (height // 4)) < 0.5 * (height // 4)
    joined = np.zeros(PAINTED.labels.shape, bool)
    joined[below_balcony] = True
    joined[:, : joined.shape[1] // 8] = True  # a pier in the shade joins them
    assert shadow_share(shadowed(joined), PAINTED.labels) < 0.2


def test_a_ground_floor_of_dark_stone_is_no_shadow() -> None:
    foot = np.zeros(PAINTED.labels.shape, bool)
    foot[3 * len(foot) // 4 :] = True
    assert shadow_share(shadowed(foot), PAINTED.labels) < 0.1
    foot[len(foot) // 2 :] = True
    assert shadow_share(shadowed(foot), PAINTED.labels) > 0.35, "two storeys"


def test_where_hardly_any_wall_is_seen_nothing_is_said() -> None:
    labels = np.full(PAINTED.labels.shape, FacadeClass.WINDOW, np.uint8)
    assert shadow_share(PAINTED.image, labels) == 0
    labels[:10, :10] = FacadeClass.WALL
    assert shadow_share(PAINTED.image, labels) == 0
