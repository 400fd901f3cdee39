"""Lenses: projection and its inverse, and walls of a painted street got back from pictures of a lens as from panoramas."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from benchmarks.painter.street_truth import SyntheticStreet, render_street_panorama, synthetic_street
from facade_core.core.lens_projection import (
    LENS_VALUES,
    lens_from_values,
    lens_values,
    picture_rays,
    project_camera_rays,
    unproject_shares,
)
from facade_core.core.types import Lens, Pose
from facade_core.imagery.cameras.occluder_masks import mask_model_edges
from facade_core.imagery.panorama_camera import (
    GROUND_REACH_M,
    camera_reach,
    is_in_view,
    pixels_per_radian,
    project_directions_to_picture,
)
from facade_core.imagery.poses.refinement import refine_pose
from facade_core.imagery.rectify.panorama import find_sightings, rectify_chart_from_panorama

SIZE = (640, 480)
PINHOLE = Lens(SIZE, (500.0, 510.0), (322.0, 239.0))
BROWN = replace(PINHOLE, radial=(-0.21, 0.06, -0.004), tangential=(0.001, -0.002), skew=1.5)
RATIONAL = replace(PINHOLE, radial=(0.3, -0.1, 0.02), denominator=(0.4, -0.05, 0.01), tangential=(0.0005, 0.001))
FISHEYE = Lens(SIZE, (280.0, 281.0), (318.0, 242.0), (0.02, -0.01, 0.003, -0.0005), fisheye=True)
LENSES = {"pinhole": PINHOLE, "brown": BROWN, "rational": RATIONAL, "fisheye": FISHEYE}


def opencv_pixels(lens: Lens, rays: np.ndarray) -> np.ndarray:
    """The pixels (n, 2) of rays by OpenCV, whose first pixel has its centre at 0; it knows no skew but a fisheye's."""
    matrix = np.array([[lens.focal[0], lens.skew, lens.centre[0]], [0, lens.focal[1], lens.centre[1]], [0, 0, 1]])
    nowhere = np.zeros(3)
    if lens.fisheye:
        return cv2.fisheye.projectPoints(rays[:, None], nowhere, nowhere, matrix, np.array(lens.radial))[0][:, 0]
    k = [*lens.radial, 0, 0, 0][:3] + [*lens.denominator, 0, 0, 0][:3]
    return cv2.projectPoints(rays, nowhere, nowhere, matrix, np.array([*k[:2], *lens.tangential, *k[2:]]))[0][:, 0]


@pytest.mark.parametrize("name", LENSES)
def test_projection_is_that_of_opencv(name: str) -> None:
    lens = replace(LENSES[name], skew=0.0)
    rays = np.random.default_rng(0).uniform([-0.5, -0.4, 1], [0.5, 0.4, 1], (200, 3))
    np.testing.assert_allclose(project_camera_rays(lens, rays) * SIZE, opencv_pixels(lens, rays), atol=1e-8)


@pytest.mark.parametrize("name", LENSES)
def test_every_pixel_has_the_ray_that_projects_to_it(name: str) -> None:
    lens = LENSES[name]
    rays = picture_rays(lens, (48, 64))
    assert np.isfinite(rays).all()
    np.testing.assert_allclose(np.linalg.norm(rays, axis=-1), 1)
    shares = project_camera_rays(lens, 7 * rays)
    np.testing.assert_allclose(shares[..., 0], np.broadcast_to((np.arange(64) + 0.5) / 64, (48, 64)), atol=1e-9)
    np.testing.assert_allclose(
        shares[..., 1], np.broadcast_to((np.arange(48)[:, None] + 0.5) / 48, (48, 64)), atol=1e-9
    )


def test_a_fisheye_sees_beside_itself_and_no_other_lens_behind() -> None:
    wide = Lens((400, 400), (100.0, 100.0), (200.0, 200.0), fisheye=True)
    assert np.isfinite(project_camera_rays(wide, np.array([1.0, 0, -0.1]))).all()
    behind = project_camera_rays(PINHOLE, np.array([[0.0, 0, -1], [0.1, 0, -1]]))
    assert np.isnan(behind).all()


def test_rays_beyond_where_distortion_folds_back_are_not_shown() -> None:
    # 1 - 0.5 r2 has its largest radius at r2 = 2 / 3; beyond, points come back into the picture
    lens = replace(PINHOLE, radial=(-0.5,))
    shares = project_camera_rays(lens, np.array([[0.7, 0, 1], [1.3, 0, 1]]))
    assert np.isfinite(shares[0]).all()
    assert np.isnan(shares[1]).all()
    assert np.isnan(unproject_shares(lens, np.array([1.6, 0.5]))).all()


@pytest.mark.parametrize("name", LENSES)
def test_numbers_of_a_lens_give_it_back(name: str) -> None:
    values = lens_values(LENSES[name])
    assert len(values) == LENS_VALUES
    assert lens_from_values(values) == LENSES[name]
    assert lens_from_values([0.0] * LENS_VALUES) is None


def test_reach_of_a_picture_from_above_grows_with_its_sharpness() -> None:
    sharp = Lens((6000, 4000), (4800.0, 4800.0), (3000.0, 2000.0))
    level, down = (Pose(0, 0, 100, 0, pitch, lens=sharp) for pitch in (-3.0, -45.0))
    assert camera_reach(level, GROUND_REACH_M) == GROUND_REACH_M
    assert camera_reach(down, GROUND_REACH_M) == pytest.approx(800)
    assert camera_reach(replace(down, lens=None), GROUND_REACH_M) == GROUND_REACH_M


@pytest.fixture(scope="module")
def street() -> SyntheticStreet:
    """A street with nothing before its houses."""
    return synthetic_street(6, seed=5, occluders=0)


def facing_pose(street: SyntheticStreet, facade: int, lens: Lens, *, turn: float = 0.0) -> Pose:
    """A camera across the street that looks at a facade, from 2.5 m over the ground."""
    charts, chart = street.scene.charts, street.charts[facade]
    middle = charts.points(chart, charts.size[chart, 0] / 2, charts.size[chart, 1] / 2)
    place = middle + 15.0 * charts.normals()[chart]
    east, north = (middle - place)[:2]
    return Pose(
        float(place[0]), float(place[1]), 2.5, float(np.degrees(np.arctan2(east, north))) + turn, 12.0, lens=lens
    )


def psnr(one: np.ndarray, other: np.ndarray) -> float:
    return float(10 * np.log10(255**2 / np.mean((one.astype(float) - other) ** 2)))


WIDE = Lens((1600, 1200), (900.0, 900.0), (803.0, 597.0), (-0.12, 0.02), tangential=(0.001, 0.0005))
WIDE_FISHEYE = Lens((1600, 1200), (700.0, 700.0), (803.0, 597.0), (0.01, -0.003), fisheye=True)


@pytest.mark.parametrize("lens", [WIDE, WIDE_FISHEYE], ids=["brown", "fisheye"])
@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_a_wall_is_got_back_from_a_distorted_picture(street: SyntheticStreet, lens: Lens, scale: float) -> None:
    pose = facing_pose(street, 1, lens, turn=8.0)
    chart, painted = street.charts[1], street.facades[1].image
    image = render_street_panorama(street, pose, round(lens.size[0] * scale))
    view = rectify_chart_from_panorama(street.scene, chart, image, pose, painted.shape[:2])
    assert view.seen.mean() > 0.8
    blurred = cv2.GaussianBlur(painted, (0, 0), 1.2 / scale)
    assert psnr(cv2.GaussianBlur(view.rgb, (0, 0), 0.8)[view.seen], blurred[view.seen]) > 26
    # the same lens without its distortion shows another place
    bare = replace(pose, lens=replace(lens, radial=(), tangential=(0.0, 0.0), fisheye=False))
    wrong = rectify_chart_from_panorama(street.scene, chart, image, bare, painted.shape[:2])
    both = view.seen & wrong.seen
    assert psnr(cv2.GaussianBlur(wrong.rgb, (0, 0), 0.8)[both], blurred[both]) < 22
    assert np.isfinite(view.quality).all()


def test_only_walls_in_view_are_sighted(street: SyntheticStreet) -> None:
    pose = facing_pose(street, 1, WIDE)
    away = replace(pose, heading=pose.heading + 180)
    chart = street.charts[1]
    (sighting,) = find_sightings(street.scene, chart, [pose, away], [(1200, 1600)] * 2)
    assert sighting.panorama == 0
    assert sighting.pixels_per_metre == pytest.approx(pixels_per_radian(pose, 1600) / 15, rel=0.25)


def test_edges_of_the_model_are_masked_where_the_picture_shows_them(street: SyntheticStreet) -> None:
    pose = facing_pose(street, 1, WIDE)
    mask = mask_model_edges(street.scene, pose, (600, 800))
    charts, chart = street.scene.charts, street.charts[1]
    corners = charts.points(
        chart, charts.size[chart, 0] * np.array([0, 1, 0.5]), charts.size[chart, 1] * np.array([0.4] * 3)
    )
    share = project_directions_to_picture(corners - [pose.x, pose.y, pose.z], pose)
    assert is_in_view(share, pose).all()
    at = (share * [800, 600]).astype(int)
    assert mask[at[:2, 1], at[:2, 0]].all()
    assert not mask[at[2, 1], at[2, 0]]


def test_a_pose_that_is_off_is_refined(street: SyntheticStreet) -> None:
    wide = Lens((1600, 1200), (650.0, 650.0), (800.0, 600.0), (-0.05,))
    true = facing_pose(street, 1, wide, turn=35.0)
    image = render_street_panorama(street, true, 1600)
    given = replace(true, heading=true.heading + 1.0, pitch=true.pitch + 0.4, roll=-0.4)
    found = refine_pose(street.scene, image, given).pose
    assert found.lens == wide
    off = np.array([(found.heading - true.heading + 180) % 360 - 180, found.pitch - true.pitch, found.roll])
    assert np.abs(off).max() < 0.25
