"""The fewest panoramas that show all facades, and fisheye pictures told from panoramas."""

from __future__ import annotations

from itertools import combinations
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from facade_core.core.types import Pose
from facade_core.geometry.scene import Scene
from facade_core.geometry.walls import WallRole
from facade_core.imagery.rectify.fisheye import is_fisheye
from facade_core.imagery.rectify.panorama import chart_point_view_quality
from facade_core.plan.panorama_choice import choose_panoramas
from facade_core.plan.settings import PANORAMA_CHOICE
from tests.facade_core.rectify.test_panorama import scene_of

SIZE = (2048, 4096)
# Six walls of 10 m in a row, seen from the south.
ROW = [((100.0 + 10 * i, 200.0), (110.0 + 10 * i, 200.0), 0.0, 8.0) for i in range(6)]


def at(x: float, y: float = 188.0) -> Pose:
    return Pose(x, y, 2.5, 0.0)


def facades_of(scene: Scene, roles: list[str] | None = None) -> Any:
    n = len(scene.charts.size)
    return cast(Any, SimpleNamespace(chart=np.arange(n), role=np.array(roles or [WallRole.STREET] * n)))


def is_covered(scene: Scene, poses: list[Pose], chosen: tuple[int, ...]) -> bool:
    """Whether of every wall that some panorama shows MIN_COVERED_SHARE is shown well enough, worked out anew."""
    for chart in range(len(scene.charts.size)):
        shown = chart_point_view_quality(scene, chart, poses, [SIZE] * len(poses))
        best = shown.max(axis=0)
        good = (shown >= PANORAMA_CHOICE.min_relative_quality * best) & (shown > 0)
        if good[list(chosen)].any(axis=0).sum() < PANORAMA_CHOICE.min_covered_share * (best > 0).sum():
            return False
    return True


def test_all_facades_are_covered_by_as_few_as_can_be() -> None:
    scene, poses = scene_of(*ROW), [at(x) for x in np.arange(96.0, 166.0, 5.0)]
    found = choose_panoramas(scene, facades_of(scene), poses, [SIZE] * len(poses))
    assert is_covered(scene, poses, found.chosen)
    least = next(k for k in range(1, 9) if any(is_covered(scene, poses, some) for some in combinations(range(14), k)))
    assert len(found.chosen) <= least + 1
    assert 1 < len(found.chosen) < len(poses)
    assert (found.facades, found.facades_shown) == (6, 6)
    assert PANORAMA_CHOICE.min_covered_share * found.shown <= found.reached <= found.shown <= 6 * 80 + 1e-6


def test_what_only_one_shows_is_taken_and_what_none_shows_asks_for_nothing() -> None:
    behind = ((170.0, 300.0), (160.0, 300.0), 0.0, 8.0)  # looks north
    lonely = ((500.0, 200.0), (510.0, 200.0), 0.0, 8.0)
    scene = scene_of(*ROW, behind, lonely)
    poses = [at(x) for x in (110.0, 130.0, 150.0)] + [at(505.0), at(900.0)]
    found = choose_panoramas(scene, facades_of(scene), poses, [SIZE] * 5)
    assert 3 in found.chosen
    assert 4 not in found.chosen
    assert (found.facades, found.facades_shown, found.covering_panoramas) == (8, 7, 4)
    only = choose_panoramas(scene, facades_of(scene, [WallRole.STREET] * 6 + [WallRole.SIDE] * 2), poses, [SIZE] * 5)
    assert 3 not in only.chosen, "a wall at no street asks for no picture"


def test_what_stands_before_a_wall_hides_it_from_a_panorama() -> None:
    screen = ((99.0, 194.0), (112.0, 194.0), 0.0, 20.0)
    poses = [at(105.0, 188.0), at(105.0, 197.0)]
    scene = scene_of(ROW[0], screen)
    assert set(
        choose_panoramas(scene, facades_of(scene, [WallRole.STREET, WallRole.SIDE]), poses, [SIZE] * 2).chosen
    ) == {1}


def test_of_two_that_show_the_same_the_first_is_taken() -> None:
    scene = scene_of(*ROW[:1])
    poses = [at(105.0)] * 3
    assert choose_panoramas(scene, facades_of(scene), poses, [SIZE] * 3).chosen == (0,)
    assert choose_panoramas(scene, facades_of(scene), [], []).chosen == ()
    assert choose_panoramas(scene_of(*ROW[:1]), facades_of(scene_of(*ROW[:1])), [at(900.0)], [SIZE]).chosen == ()


@pytest.mark.parametrize("circles", [1, 2])
def test_a_fisheye_is_black_around_its_circles(circles: int) -> None:
    rng = np.random.default_rng(0)
    shape = (200, 200 * circles)
    x, y = np.meshgrid(np.arange(shape[1]) % 200 - 99.5, np.arange(200) - 99.5)
    picture = rng.integers(60, 220, (*shape, 3)).astype(np.uint8)
    fisheye = picture.copy()
    fisheye[np.hypot(x, y) > 100] = 3
    assert is_fisheye(fisheye)
    assert not is_fisheye(picture)
    assert not is_fisheye(np.full((*shape, 3), 4, np.uint8)), "a night"
    mask = picture.copy()
    mask[int(0.72 * 200) :] = 0
    assert not is_fisheye(mask), "a panorama whose rig is masked at the bottom"
