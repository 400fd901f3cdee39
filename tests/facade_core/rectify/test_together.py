"""Panoramas of a synthetic street, refined together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.painter.street_truth import SyntheticStreet, render_street_panorama, synthetic_street
from facade_core.core.types import Pose
from facade_core.geometry.charts import ChartKind
from facade_core.imagery.panorama_camera import camera_position
from facade_core.imagery.poses.joint_refinement import JointPose, PriorPose, refine_jointly
from facade_core.imagery.poses.shared_walls import GradientImage, _find_shift, _gradient_correlation, _match_patches

WIDTH = 2048
# The covariance of a place that outlines of buildings told well.
TOLD = np.diag([0.02, 0.02, 0.02, 0.05]) ** 2


@pytest.fixture(scope="module")
def street() -> SyntheticStreet:
    return synthetic_street(4, seed=3, texels_per_metre=14.0)


@pytest.fixture(scope="module")
def shots(street: SyntheticStreet) -> list[tuple[Pose, np.ndarray]]:
    """Three cameras on the street, and what they see."""
    found = []
    for number, (share, side) in enumerate(((0.3, 1.5), (0.5, -1.5), (0.7, 1.0))):
        x, y = street.world_point(share * street.length, side)
        pose = Pose(float(x), float(y), 2.5, 40.0 + 70 * number, pitch=0.6, roll=-0.4)
        found.append((pose, render_street_panorama(street, pose, WIDTH, gain=1 - 0.1 * number, seed=number)))
    return found


def refined(street: SyntheticStreet, images: list[np.ndarray], alone: list[PriorPose]) -> list[JointPose]:
    surfaces = np.flatnonzero(np.isin(street.scene.charts.kind, (ChartKind.WALL, ChartKind.GROUND))).tolist()
    return refine_jointly(street.scene, surfaces, iter(images), alone)


def off(pose: Pose, true: Pose) -> float:
    return float(np.linalg.norm(camera_position(pose) - camera_position(true)))


@pytest.mark.long
def test_a_height_that_was_stated_wrong_is_found_by_what_neighbours_show(
    street: SyntheticStreet, shots: list[tuple[Pose, np.ndarray]]
) -> None:
    (first, *_), (wrong, *_), (third, *_) = shots
    alone = [PriorPose(first, TOLD), PriorPose(replace(wrong, z=4.1, x=wrong.x + 0.2), None), PriorPose(third, TOLD)]
    found = refined(street, [image for _, image in shots], alone)
    assert [one.reason for one in found] == ["", "", ""]
    assert off(found[1].pose, wrong) < 0.15
    assert max(off(found[0].pose, first), off(found[2].pose, third)) < 0.05, "their own outlines told them"
    assert found[1].distance_before > 0.5 > 0.1 > found[1].distance_after
    assert found[1].surfaces >= 2


def test_a_picture_of_something_else_pulls_nobody(
    street: SyntheticStreet, shots: list[tuple[Pose, np.ndarray]]
) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (WIDTH // 2, WIDTH, 3), dtype=np.uint8)
    alone = [PriorPose(pose, TOLD) for pose, _ in shots]
    found = refined(street, [shots[0][1], noise, shots[2][1]], alone)
    assert found[1].reason.startswith("alone: ")
    assert found[1].pose == alone[1].pose
    assert max(off(one.pose, pose) for one, (pose, _) in zip(found, shots, strict=True)) < 0.05


def wall(right: int, down: int, bay: int = 200) -> GradientImage:
    """A wall of 20 x 16 m, moved by texels; bay: after so many it repeats."""
    whole = np.random.default_rng(1).integers(10, 256, (160, 200)).astype(np.float32)
    whole = np.tile(whole[:, :bay], (1, 200 // bay + 1))[:, :200]
    rows, columns = (at - by for at, by in zip(np.indices(whole.shape), (down, right), strict=True))
    inside = (rows >= 0) & (rows < 160) & (columns >= 0) & (columns < 200)
    return GradientImage(np.where(inside, whole[rows % 160, columns % 200], 0.0).astype(np.float32), inside)


def test_patches_lie_as_far_off_as_the_wall_was_moved() -> None:
    one, other = wall(0, 0), wall(-9, 14)
    assert _find_shift(one, other, 2.6) == (9, -14)
    found = _match_patches(one, other, (9, -14))
    assert len(found) > 30
    for (x, y), (u, v) in found:
        assert (x - u, y - v) == pytest.approx((9, -14), abs=0.3)


def test_a_wall_that_repeats_does_not_tell_where_it_is() -> None:
    assert _find_shift(wall(0, 0), wall(0, 0), 2.6) == (0, 0)
    assert _find_shift(wall(0, 0, bay=14), wall(0, 0, bay=14), 2.6) is None
    assert _gradient_correlation(wall(0, 0), wall(1, 0)) == pytest.approx(1.0, abs=1e-3)
    assert _gradient_correlation(wall(0, 0), wall(8, 0)) < 0.2
