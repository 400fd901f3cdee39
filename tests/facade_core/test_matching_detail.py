"""Ground that two cameras show in the same detail is bare, whatever else masks it; what is private stays masked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.painter.street_paint import ground_pattern_painter
from benchmarks.painter.street_truth import render_street_panorama, synthetic_street
from facade_core.core.types import Pose
from facade_core.geometry.charts import ChartKind
from facade_core.imagery.cameras.camera_view import PanoramaCamera
from facade_core.imagery.cameras.exposure import sample_ground_colours, typical_ground_colour
from facade_core.imagery.cameras.ground import fuse_ground_view
from facade_core.imagery.cameras.matching_detail import find_matching_detail, select_parallax_pairs
from facade_core.imagery.rectify.fusion import ChartView

SIZE, DENSITY = (160, 200), 16.0


def make_view(rgb: np.ndarray) -> ChartView:
    """View that a mask calls occluded everywhere."""
    whole = np.ones(rgb.shape[:2], bool)
    return ChartView(rgb.clip(0, 255).astype(np.uint8), whole, whole.astype(np.float32), whole)


def draw_speckles(seed: int, shape: tuple[int, int] = SIZE) -> np.ndarray:
    grain = np.random.default_rng(seed).normal(0, 14, (shape[0] // 4, shape[1] // 4)).repeat(4, 0).repeat(4, 1)
    return np.repeat(110 + grain[..., None], 3, axis=2)


def test_the_same_detail_is_found_and_an_object_at_two_places_is_not() -> None:
    ground, car = draw_speckles(0), draw_speckles(1, (64, 64))
    rng = np.random.default_rng(2)
    views = []
    for left in (40, 100):
        rgb = ground + rng.normal(0, 3, ground.shape)
        rgb[48:112, left : left + 64] = car
        views.append(make_view(rgb))
    for found, left in zip(find_matching_detail(views, DENSITY, [(1, 0)]), (40, 100), strict=True):
        assert found[:, :30].mean() > 0.95
        assert found[:, 175:].mean() > 0.95
        assert found[56:104, left + 8 : left + 56].mean() < 0.02
    assert not any(one.any() for one in find_matching_detail(views, DENSITY, []))


@pytest.mark.parametrize("colours", [(110, 110), (110, 200)], ids=["without detail", "of another colour"])
def test_surfaces_without_shared_detail_prove_nothing(colours: tuple[float, float]) -> None:
    rng = np.random.default_rng(3)
    grain = 0 if colours[0] == colours[1] else draw_speckles(0) - 110
    views = [make_view(colour + grain + rng.normal(0, 3, (*SIZE, 3))) for colour in colours]
    assert not any(one.any() for one in find_matching_detail(views, DENSITY, [(1, 0)]))


def test_cameras_beside_each_other_see_one_object_at_one_place() -> None:
    poses = [Pose(0.0, 0.0, 2.5, 0.0), Pose(0.5, 0.0, 2.5, 90.0), Pose(3.0, 0.0, 2.5, 0.0)]
    assert select_parallax_pairs(poses, 0.0) == [(2, 0), (2, 1)]


def test_ground_that_the_parser_masks_is_taken_but_for_the_private_part() -> None:
    street = synthetic_street(4, seed=3, occluders=0, texels_per_metre=8.0)
    paint, scene, cameras = ground_pattern_painter(street), street.scene, []
    for along in (8.0, 12.0):
        x, y = street.world_point(along, 0.5)
        pose = Pose(float(x), float(y), 2.5, 40.0)
        image = render_street_panorama(street, pose, 1024, ground=paint)
        colour = typical_ground_colour(sample_ground_colours(scene, image, pose).squares)
        cameras.append(PanoramaCamera(image, pose, np.ones(image.shape[:2], bool), np.ones(3), colour))
    grounds = np.flatnonzero(scene.charts.kind == ChartKind.GROUND).tolist()

    def count_taken_texels(some: list[PanoramaCamera]) -> int:
        found = [fuse_ground_view(scene, chart, some) for chart in grounds]
        return sum(int(one.is_visible.sum()) for one in found if one is not None)

    assert count_taken_texels(cameras) > 8_000
    assert count_taken_texels([replace(one, private=one.occluded) for one in cameras]) == 0
    assert count_taken_texels(cameras[:1]) == 0
