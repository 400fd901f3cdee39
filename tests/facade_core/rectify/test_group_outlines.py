"""Overlapping photos of known relative poses find their place by the outlines that they show together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.painter.street_truth import SyntheticStreet, render_street_panorama, synthetic_street
from facade_core.core.types import Lens, Pose
from facade_core.imagery.panorama_camera import camera_from_world, camera_position, rotate_pose
from facade_core.imagery.poses.group_outlines import align_to_outlines

LENS = Lens((320, 240), (200.0, 200.0), (160.0, 120.0))
COUNT = 12


@pytest.fixture(scope="module")
def street() -> SyntheticStreet:
    return synthetic_street(6, seed=3, occluders=1, texels_per_metre=12.0, with_roofs=True)


@pytest.fixture(scope="module")
def true(street: SyntheticStreet) -> list[Pose]:
    ahead = np.array([-street.axis[1], street.axis[0]])
    heading = float(np.degrees(np.arctan2(*ahead)))
    poses = []
    for number in range(COUNT):
        x, y = street.world_point((number + 0.5) / COUNT * street.length, -4.0).tolist()
        poses.append(Pose(x, y, 1.6, heading + (-20.0, 20.0)[number % 2], 12.0, lens=LENS))
    return poses


@pytest.fixture(scope="module")
def images(street: SyntheticStreet, true: list[Pose]) -> list[np.ndarray]:
    return [render_street_panorama(street, pose, LENS.size[0], seed=number) for number, pose in enumerate(true)]


def displace(street: SyntheticStreet, true: list[Pose], along: float, scale: float, turn_deg: float) -> list[Pose]:
    """Move poses as one."""
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])  # clockwise from above
    centres = np.array([camera_position(pose) for pose in true])
    middle = centres.mean(axis=0)
    moved = middle + [*(along * street.axis), 0.0] + scale * (centres - middle) @ turn.T
    return [
        replace(rotate_pose(pose, turn), x=float(x), y=float(y), z=float(z))
        for pose, (x, y, z) in zip(true, moved.tolist(), strict=True)
    ]


def test_photos_that_are_off_as_one_come_to_their_places(
    street: SyntheticStreet, true: list[Pose], images: list[np.ndarray]
) -> None:
    given = displace(street, true, along=1.6, scale=1.05, turn_deg=0.6)
    centres = np.array([camera_position(pose) for pose in true])
    gps = np.array([camera_position(pose)[:2] for pose in given])
    gps[3] = np.nan
    found = align_to_outlines(street.scene, given, lambda number: images[number], gps, np.full(COUNT, 1.6))
    assert found is not None
    assert found.fit > found.given_fit
    before = np.linalg.norm([camera_position(pose) for pose in given] - centres, axis=1)
    after = np.linalg.norm(found.centres - centres, axis=1)
    assert np.median(before) > 1.2
    assert np.median(after) < 0.3
    turned = [
        camera_from_world(pose) @ found.rotation.T @ camera_from_world(one).T
        for pose, one in zip(given, true, strict=True)
    ]
    assert max(np.degrees(np.arccos(np.clip((np.trace(t) - 1) / 2, -1, 1))) for t in turned) < 0.4


def test_photos_that_show_no_outlines_stay(street: SyntheticStreet, true: list[Pose]) -> None:
    gps = np.array([camera_position(pose)[:2] for pose in true])
    grey = np.full((240, 320, 3), 90, np.uint8)
    assert align_to_outlines(street.scene, true, lambda _: grey, gps, np.full(COUNT, 1.6)) is None


def test_photos_stay_where_gps_is_better_than_a_metre(
    street: SyntheticStreet, true: list[Pose], images: list[np.ndarray]
) -> None:
    """At their true places the outlines move them by little."""
    centres = np.array([camera_position(pose) for pose in true])
    found = align_to_outlines(street.scene, true, lambda n: images[n], centres[:, :2], np.full(COUNT, 1.6))
    off = np.zeros(1) if found is None else np.linalg.norm(found.centres - centres, axis=1)
    assert off.max() < 0.2
