"""The benchmark of mesh texturing: views that are compared."""

from __future__ import annotations

import numpy as np

from benchmarks.mesh_texturing import comparison
from benchmarks.mesh_texturing.comparison import ComparedView, measure_likeness
from benchmarks.mesh_texturing.views import cut_view, perspective_cameras
from facade_core.core.types import Pose
from facade_core.export.pictures.camera import PerspectiveCamera
from facade_core.imagery.panorama_camera import camera_from_world, camera_position, project_directions_to_picture

POSE = Pose(4200.5, 7300.25, 2.5, heading=37.0, pitch=1.5, roll=-0.8)


def test_a_view_shows_what_the_panorama_shows_in_its_directions() -> None:
    share = np.stack(np.meshgrid((np.arange(512) + 0.5) / 512, (np.arange(256) + 0.5) / 256), axis=-1)
    camera = perspective_cameras(POSE, 64)[5]
    found = cut_view(share.astype(np.float32), POSE, camera.rays())
    expected = project_directions_to_picture(camera.rays(), POSE)
    away_from_border = (expected[..., 0] > 0.01) & (expected[..., 0] < 0.99)
    assert away_from_border.any()
    np.testing.assert_allclose(found[away_from_border], expected[away_from_border], atol=2e-3)


def test_another_exposure_is_no_error_and_another_picture_is() -> None:
    rng = np.random.default_rng(1)
    truth = np.kron(rng.integers(60, 200, (8, 8, 3)), np.ones((8, 8, 1))).astype(np.uint8)
    darker = (truth * np.array([0.5, 0.6, 0.7])).round().astype(np.uint8)
    other = rng.integers(0, 255, truth.shape, dtype=np.uint8)
    whole, none = np.ones(truth.shape[:2], bool), np.zeros(truth.shape[:2], bool)
    regions = {"walls, seen": whole, "walls, everywhere": whole, "ground, seen": none, "ground, everywhere": none}
    told = measure_likeness([ComparedView(truth, {"ours": darker, "plain": other}, regions)])
    assert told["walls, seen"]["ours"][0] > 45
    assert told["walls, seen"]["plain"][0] < 12
    assert told["ground, seen"] == {"share": 0.0}


def test_rasters_longer_than_opencv_takes_in_a_row_are_sampled() -> None:
    raster = np.arange(256, dtype=np.uint8)[None, :, None].repeat(2, 0).repeat(3, 2)
    x = np.random.default_rng(0).integers(0, 256, (1, 40_000)).astype(np.float32)
    found = comparison._remap(raster, x, np.zeros_like(x))
    np.testing.assert_array_equal(found[:, 0], x[0])


def test_views_are_taken_from_where_the_panorama_was() -> None:
    cameras = perspective_cameras(POSE, 10)
    assert all(isinstance(camera, PerspectiveCamera) for camera in cameras)
    np.testing.assert_allclose([camera.position for camera in cameras], camera_position(POSE)[None].repeat(16, 0))


def test_perspective_pictures_are_off_by_what_is_said_and_look_at_houses() -> None:
    from benchmarks.mesh_texturing.cases import PICTURE_NOISE_DEG, PICTURE_NOISE_M, perspective_cases

    found = perspective_cases(seed=3, buildings=2, pictures=3, width=96)
    (true,), (off,) = found["true"], found["off"]
    for one, stated in zip(true.taken, off.poses, strict=True):
        assert one.image.shape == (72, 96, 3)
        assert one.pose.lens == stated.lens
        np.testing.assert_allclose(np.linalg.norm(camera_position(stated) - camera_position(one.pose)), PICTURE_NOISE_M)
        turn = camera_from_world(stated) @ camera_from_world(one.pose).T
        assert 0 < np.degrees(np.arccos((np.trace(turn) - 1) / 2)) < 1.1 * PICTURE_NOISE_DEG
        # across the street, not along it
        start, end = (np.array(point) for point in true.streets[0].line.coords)
        along = (end - start) / np.linalg.norm(end - start)
        assert abs(camera_from_world(one.pose)[2, :2] @ along) < 0.75
