"""Panoramas of a synthetic street that were not taken as their poses say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.painter.street_truth import SyntheticStreet, render_street_panorama, synthetic_street
from facade_core.core.types import Pose
from facade_core.imagery.poses.misplaced import explain_misplacement
from facade_core.imagery.poses.outlines import sample_visible_outlines
from facade_core.imagery.poses.refinement import refine_pose

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def street() -> SyntheticStreet:
    return synthetic_street(8, seed=3, texels_per_metre=14.0)


@pytest.fixture(scope="module")
def shot(street: SyntheticStreet) -> tuple[Pose, np.ndarray]:
    x, y = street.world_point(0.45 * street.length, 1.0)
    pose = Pose(float(x), float(y), 2.5, 40.0)
    return pose, render_street_panorama(street, pose, 2048)


def why(street: SyntheticStreet, image: np.ndarray, given: Pose) -> str:
    found = refine_pose(street.scene, image, given)
    return explain_misplacement(
        street.scene, image, found.pose, sample_visible_outlines(street.scene, found.pose), found.fit
    )


def test_a_pose_that_is_a_little_off_is_not_doubted(street: SyntheticStreet, shot: tuple[Pose, np.ndarray]) -> None:
    pose, image = shot
    given = replace(pose, x=pose.x + 0.25, y=pose.y - 0.17, heading=pose.heading - 1.0)
    assert why(street, image, given) == ""
    # nor is one far from all buildings, where nothing tells
    assert why(street, image, replace(pose, x=pose.x + 900.0)) == ""


def test_a_mirrored_picture_says_so(street: SyntheticStreet, shot: tuple[Pose, np.ndarray]) -> None:
    pose, image = shot
    assert why(street, np.ascontiguousarray(image[:, ::-1]), pose).startswith("is mirrored: outlines of buildings fit")


@pytest.mark.parametrize("degrees", [90.0, -12.0])
def test_a_heading_that_lies_is_told(street: SyntheticStreet, shot: tuple[Pose, np.ndarray], degrees: float) -> None:
    pose, image = shot
    said = why(street, image, replace(pose, heading=(pose.heading + degrees) % 360))
    assert said.startswith("is turned: ")
    assert f" at a heading {-degrees:+.0f} degrees off" in said
    assert said.endswith("mend its heading, or remove it")


def test_a_place_that_lies_is_told(street: SyntheticStreet, shot: tuple[Pose, np.ndarray]) -> None:
    """Four metres down the street and two across it."""
    pose, image = shot
    there = street.world_point(0.45 * street.length + 4.0, -1.0)
    said = why(street, image, replace(pose, x=float(there[0]), y=float(there[1])))
    assert said.startswith("was taken elsewhere: ")
    assert said.endswith("mend its place, or remove it")
