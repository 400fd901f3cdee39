"""The rectification benchmark's own measure: its cameras, its errors, and what it counts."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.rectification import Camera, _skew, camera, errors, summary


def frontal(distortion: float = 0.0) -> Camera:
    return Camera(np.eye(3), np.array([0.0, 0.0, -20.0]), 1000.0, distortion, (1000, 1500))


def test_rays_are_the_inverse_of_projection_with_distortion() -> None:
    view = camera(np.random.default_rng(4), 12.0, 18.0)
    rays = view.rays()[::97, ::89].reshape(-1, 3)
    y, x = np.mgrid[: view.size[0], : view.size[1]][:, ::97, ::89].reshape(2, -1)
    assert np.abs(view.project(view.position + 7.0 * rays) - np.column_stack([x, y])).max() < 0.05


def test_cameras_stand_before_the_facade_and_have_most_of_it_in_view() -> None:
    for seed in range(20):
        view = camera(np.random.default_rng(seed), 20.0, 18.0)
        assert view.position[2] < 0
        corners = view.project(np.array([[x, y, 0.0] for x in (-10, 10) for y in (-9, 9)]))
        assert (np.abs(corners / view.size[::-1] - 0.5) < 0.6).all()


def test_the_true_homography_has_no_errors_and_a_turned_one_its_angle() -> None:
    size, extent = (1000, 1500), (12.0, 18.0)
    assert errors(frontal(), np.eye(3), size, extent)["axis_error"] == pytest.approx(0, abs=1e-6)
    turned, stretched = np.eye(3), np.diag([1.2, 1.0, 1.0])
    c, s = np.cos(np.radians(2)), np.sin(np.radians(2))
    turned[:2, :2] = [[c, -s], [s, c]]
    assert errors(frontal(), turned, size, extent)["axis_error"] == pytest.approx(2, abs=1e-6)
    assert errors(frontal(), stretched, size, extent)["aspect_error"] == pytest.approx(0.2, abs=1e-6)
    assert errors(frontal(), np.eye(3), (500, 1500), extent)["kept"] == pytest.approx(0.53, abs=0.05)


def test_wild_results_and_refusals_are_counted_apart() -> None:
    good = {"case": 0, "name": "a", "seconds": 1.0, "axis_error": 0.1, "aspect_error": 0.0, "kept": 1.0, "facade": 0.8}
    rows = [good, good | {"axis_error": 6.0}, good | {"aspect_error": 0.4}]
    refused = {"case": 3, "name": "b", "seconds": 1.0, "refusal": "photo: no"}
    counted = summary([*rows, refused])
    assert (counted["photos"], counted["refused"], counted["wild"]) == (4, 1, 2)
    assert counted["refusals"] == ["b (3): photo: no"]


def test_skew_is_the_angle_to_the_nearer_axis() -> None:
    angle = np.radians(1.5)
    ends = 50 * np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    assert _skew(np.stack([np.zeros((2, 2)), ends], axis=1)) == pytest.approx(1.5)
