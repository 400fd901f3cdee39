"""The benchmark of mesh texturing: cameras as MeshLab states them, the divided mesh, and views that are compared."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.mesh_texturing import comparison
from benchmarks.mesh_texturing.comparison import ComparedView, measure_likeness
from benchmarks.mesh_texturing.registered_rasters import (
    FaceTexture,
    cut_view,
    divide_triangles,
    perspective_cameras,
    raster_cameras,
    shot_attributes,
)
from facade_core.core.lens_projection import picture_rays
from facade_core.core.types import Lens, Pose
from facade_core.export.pictures.camera import PerspectiveCamera
from facade_core.geometry.charts import Mesh
from facade_core.imagery.panorama_camera import camera_from_world, camera_position, project_directions_to_picture

POSE = Pose(4200.5, 7300.25, 2.5, heading=37.0, pitch=1.5, roll=-0.8)
WALL = np.array([[0.0, 10, 0], [6, 10, 0], [6, 10, 4], [0, 10, 4]])


def wall_mesh() -> Mesh:
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return Mesh(WALL, triangles, np.zeros(2, np.int32), np.zeros(4, np.int32))


def project_by_shot(attributes: dict[str, str], points: np.ndarray) -> np.ndarray:
    """Project points (n, 3) as VCG does: y counts from the bottom of the picture."""
    values = {name: np.array(text.split(), float) for name, text in attributes.items()}
    camera = (points + values["TranslationVector"][:3]) @ values["RotationMatrix"].reshape(4, 4)[:3, :3].T
    plane = values["FocalMm"][0] / values["PixelSizeMm"] * camera[:, :2] / -camera[:, 2:]
    x, y = (plane + values["CenterPx"]).T
    return np.stack([x, values["ViewportPx"][1] - y], axis=1)


@pytest.mark.parametrize("number", [0, 3, 11])
def test_a_point_is_at_the_same_pixel_of_our_camera_and_of_the_shot(number: int) -> None:
    camera, origin = perspective_cameras(POSE, 200)[number], np.array([4200.0, 7300.0, 0.0])
    rows, columns = np.array([3, 120, 199]), np.array([7, 60, 150])
    points = camera.position + 20 * camera.rays()[rows, columns]
    found = project_by_shot(shot_attributes(camera, origin), points - origin)
    np.testing.assert_allclose(found, np.stack([columns, rows], axis=1) + 0.5, atol=1e-6)


def test_a_view_shows_what_the_panorama_shows_in_its_directions() -> None:
    share = np.stack(np.meshgrid((np.arange(512) + 0.5) / 512, (np.arange(256) + 0.5) / 256), axis=-1)
    camera = perspective_cameras(POSE, 64)[5]
    found = cut_view(share.astype(np.float32), POSE, camera.rays())
    expected = project_directions_to_picture(camera.rays(), POSE)
    away_from_border = (expected[..., 0] > 0.01) & (expected[..., 0] < 0.99)
    assert away_from_border.any()
    np.testing.assert_allclose(found[away_from_border], expected[away_from_border], atol=2e-3)


def test_a_raster_of_a_picture_of_a_lens_shows_it_without_distortion() -> None:
    lens = Lens((640, 480), (480.0, 480.0), (320.0, 240.0), (-0.08, 0.01))
    pose = Pose(4200.5, 7300.25, 2.5, heading=37.0, pitch=4.0, roll=1.0, lens=lens)
    rays = picture_rays(lens, (240, 320)) @ camera_from_world(pose)
    (camera,) = raster_cameras(pose, 320)
    found = cut_view(rays.astype(np.float32), pose, camera.rays())
    assert found.shape == (228, 304, 3)
    np.testing.assert_allclose(found, camera.rays(), atol=2e-3)


def test_a_divided_mesh_covers_the_same_area_by_short_edges() -> None:
    divided = divide_triangles(wall_mesh(), 1.0)
    corners = divided.vertices[divided.triangles]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert edges.max() <= 1.0
    assert (normals[:, 1] < 0).all()  # none is turned over
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1).sum() / 2, 24.0)
    np.testing.assert_array_equal(divided.chart, np.arange(len(corners)))


def test_a_textured_mesh_is_sampled_where_its_coordinates_say_and_not_without() -> None:
    mesh = divide_triangles(wall_mesh(), 1.0)
    uv = (mesh.vertices[mesh.triangles][..., [0, 2]] + 1) / 10
    bare = mesh.vertices[mesh.triangles][..., 0].mean(axis=1) > 3
    uv[bare] = 0
    v, u = np.meshgrid(1 - (np.arange(100) + 0.5) / 100, (np.arange(100) + 0.5) / 100, indexing="ij")
    image = np.stack([255 * u, 255 * v, 0 * u], axis=-1).round().astype(np.uint8)
    places = np.array([[1.25, 10, 1.5], [2.0, 10, 3.25], [5.0, 10, 2.0]])
    rgb, has = FaceTexture(mesh, uv, image).sample(np.array([2.0, 0, 1]), (places - [2.0, 0, 1])[None])
    assert has[0].tolist() == [True, True, False]
    np.testing.assert_allclose(rgb[0, :2, :2], 255 * (places[:2, [0, 2]] + 1) / 10, atol=2)


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
