"""Poses refined on a synthetic street whose panoramas are rendered by ray casting."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.painter.street_truth import SyntheticStreet, render_street_panorama, synthetic_street
from facade_core.core.errors import GeometryError, ImageError
from facade_core.core.types import Pose
from facade_core.imagery.panorama_camera import camera_from_world, camera_position, rotate_pose
from facade_core.imagery.poses.refinement import refine_pose

WIDTH = 2048


@pytest.fixture(scope="module")
def street() -> SyntheticStreet:
    return synthetic_street(4, seed=3, texels_per_metre=14.0)


@pytest.fixture(scope="module")
def shot(street: SyntheticStreet) -> tuple[Pose, np.ndarray]:
    x, y = street.world_point(0.45 * street.length, 1.0)
    pose = Pose(float(x), float(y), 2.5, 40.0, pitch=0.6, roll=-0.4)
    return pose, render_street_panorama(street, pose, WIDTH)


def angle(one: Pose, other: Pose) -> float:
    trace = np.trace(camera_from_world(one) @ camera_from_world(other).T)
    return float(np.degrees(np.arccos(np.clip((trace - 1) / 2, -1, 1))))


def test_a_pose_that_is_off_comes_back(street: SyntheticStreet, shot: tuple[Pose, np.ndarray]) -> None:
    pose, image = shot
    given = replace(pose, x=pose.x + 0.25, y=pose.y - 0.17, heading=pose.heading - 1.0, pitch=pose.pitch + 0.4)
    refined = refine_pose(street.scene, image, given)
    assert refined.reasons == ()
    assert angle(refined.pose, pose) < 0.25
    assert np.linalg.norm(camera_position(refined.pose) - camera_position(pose)) < 0.1
    assert refined.residual_degrees < 0.5 < refined.given_degrees
    assert refined.fit > refined.given_fit
    assert refined.turned_deg == pytest.approx(1.08, abs=0.3)
    assert refined.moved_m == pytest.approx(0.30, abs=0.1)
    assert refined.covariance is not None
    assert np.sqrt(np.diag(refined.covariance)).max() < 0.15, "outlines all around tell place and heading"
    again = refine_pose(street.scene, image, given)
    assert again.pose == refined.pose
    assert np.array_equal(again.covariance, refined.covariance)


def test_an_exact_pose_stays_within_its_resolution(street: SyntheticStreet, shot: tuple[Pose, np.ndarray]) -> None:
    pose, image = shot
    refined = refine_pose(street.scene, image, pose)
    assert angle(refined.pose, pose) < 0.25
    assert np.linalg.norm(camera_position(refined.pose) - camera_position(pose)) < 0.08


def test_a_picture_of_something_else_changes_nothing(street: SyntheticStreet, shot: tuple[Pose, np.ndarray]) -> None:
    pose, _ = shot
    noise = np.random.default_rng(0).integers(0, 256, (WIDTH // 2, WIDTH, 3), dtype=np.uint8)
    refined = refine_pose(street.scene, noise, pose)
    assert refined.pose == pose
    assert len(refined.reasons) == 2
    assert refined.moved_m == refined.turned_deg == 0


def test_a_height_is_mended_where_it_is_stated_and_held_where_it_is_carried(
    street: SyntheticStreet, shot: tuple[Pose, np.ndarray]
) -> None:
    pose, image = shot
    given = replace(pose, z=4.4)
    found = refine_pose(street.scene, image, given)
    assert np.linalg.norm(camera_position(found.pose) - camera_position(pose)) < 0.1
    held = refine_pose(street.scene, image, given, height_is_assumed=True)
    assert camera_position(held.pose)[2] > 3.5, "half a metre, and a little by the simplex"


def test_far_from_all_buildings_there_is_no_evidence(street: SyntheticStreet, shot: tuple[Pose, np.ndarray]) -> None:
    pose, image = shot
    away = replace(pose, x=pose.x + 900.0)
    refined = refine_pose(street.scene, image, away)
    assert refined.pose == away
    assert (refined.lines, refined.outlines) == (0, 0)
    assert np.isnan(refined.residual_degrees)


def test_unusable_input_is_refused(street: SyntheticStreet, shot: tuple[Pose, np.ndarray]) -> None:
    pose, image = shot
    with pytest.raises(GeometryError, match="no height"):
        refine_pose(street.scene, image, replace(pose, z=None))
    with pytest.raises(ImageError, match="uint8 RGB"):
        refine_pose(street.scene, image[..., 0], pose)


def test_a_turned_pose_sees_the_turned_world() -> None:
    pose = Pose(1.0, 2.0, 3.0, 310.0, pitch=-7.0, roll=4.0, view=(0.1, 0.2, 0.5, 0.5))
    turn = camera_from_world(Pose(0, 0, 0, 12.0, pitch=1.0, roll=-2.0))
    after = rotate_pose(pose, turn)
    assert camera_from_world(after) == pytest.approx(camera_from_world(pose) @ turn.T)
    assert after.view == pose.view
    assert rotate_pose(pose, np.eye(3)).heading == pytest.approx(310.0)
