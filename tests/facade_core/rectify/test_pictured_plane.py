"""Pictures of walls that show the wall's plane, a turned one, and one at another depth."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from facade_core.imagery.rectify.fusion import ChartView
from facade_core.imagery.rectify.pictured_plane import (
    CameraFrame,
    estimate_pictured_depth,
    estimate_pictured_turn,
    explain_other_planes,
)

# Of the raster, and a wall's metres.
DENSITY, WIDTH_M, HEIGHT_M = 12.0, 16.0, 12.0
CAMERAS = (CameraFrame(3.0, 9.5, 10.0), CameraFrame(12.0, 9.5, 12.0))


def painted_wall(seed: int = 0) -> np.ndarray:
    """Draw a facade (960, 1600, 3) of 20 x 12 m at 0.0125 m: windows with bars, of uneven sizes, on bands."""
    rng = np.random.default_rng(seed)
    wall = np.full((960, 1600, 3), 170, np.uint8)
    for floor, top in enumerate(range(60, 900, 240)):
        cv2.rectangle(wall, (0, top - 40), (1600, top - 30), (120, 110, 100), -1)
        for left in range(50 + 10 * floor, 1500, 200):
            wide, high = rng.integers(80, 130), rng.integers(110, 170)
            shade = int(rng.integers(20, 90))
            cv2.rectangle(wall, (left, top), (left + int(wide), top + int(high)), (shade, shade, shade + 10), -1)
            cv2.line(wall, (left, top + 50), (left + int(wide), top + 50), (230, 230, 230), 4)
    return np.clip(wall + rng.normal(0, 2, wall.shape), 0, 255).astype(np.uint8)


def seen_wall(camera: CameraFrame, *, turn_deg: float = 0.0, behind: float = 0.0, seed: int = 0) -> ChartView:
    """Rectify on a wall what a camera sees of a painted plane, turned about the wall's middle and moved behind it."""
    turn = np.radians(turn_deg)
    across = np.array([np.cos(turn), 0.0, np.sin(turn)]) * 20.0
    corner = np.array([WIDTH_M / 2, 0.0, behind]) - across / 2
    foot = np.array([0.0, HEIGHT_M, 0.0])
    corners = np.array([corner, corner + across, corner + across + foot, corner + foot])
    offset = corners - [camera.right, camera.down, -camera.before]
    on_wall = offset[:, :2] * (camera.before / offset[:, 2:]) + [camera.right, camera.down]
    there = np.array([[0, 0], [1600, 0], [1600, 960], [0, 960]], np.float32)
    size = (round(WIDTH_M * DENSITY), round(HEIGHT_M * DENSITY))
    matrix = cv2.getPerspectiveTransform(there, (on_wall * DENSITY).astype(np.float32))
    rgb = cv2.warpPerspective(painted_wall(seed), matrix, size, flags=cv2.INTER_AREA)
    seen = cv2.warpPerspective(np.ones((960, 1600), np.uint8), matrix, size, flags=cv2.INTER_NEAREST) > 0
    return ChartView(rgb, seen, seen.astype(np.float32))


@pytest.mark.parametrize("turn_deg", [-40.0, -12.0, 15.0, 45.0])
def test_the_turn_of_another_plane_is_found(turn_deg: float) -> None:
    found = estimate_pictured_turn(seen_wall(CAMERAS[0], turn_deg=turn_deg), CAMERAS[0], DENSITY)
    assert found.is_other
    assert found.turn_deg == pytest.approx(turn_deg, abs=2.0)


@pytest.mark.parametrize("turn_deg", [-3.0, 0.0, 2.0])
@pytest.mark.parametrize("camera", CAMERAS)
def test_a_wall_with_an_error_of_its_pose_is_kept(turn_deg: float, camera: CameraFrame) -> None:
    assert not estimate_pictured_turn(seen_wall(camera, turn_deg=turn_deg), camera, DENSITY).is_other


def test_pictures_without_level_lines_say_nothing() -> None:
    view = seen_wall(CAMERAS[0])
    for rgb in (np.full_like(view.rgb, 120), np.where(np.arange(192)[:, None] % 16 < 8, 60, 180).astype(np.uint8)):
        bare = ChartView(np.broadcast_to(rgb, view.rgb.shape).copy(), view.seen, view.quality)
        assert not estimate_pictured_turn(bare, CAMERAS[0], DENSITY).is_other


def test_another_building_that_is_taken_for_an_occluder_is_found() -> None:
    view = seen_wall(CAMERAS[0], turn_deg=30.0)
    hidden = ChartView(view.rgb, view.seen, view.quality, view.seen)
    assert estimate_pictured_turn(hidden, CAMERAS[0], DENSITY).is_other


@pytest.mark.parametrize("behind", [-4.0, 6.0])
def test_the_depth_of_another_plane_is_found(behind: float) -> None:
    views = [seen_wall(camera, behind=behind) for camera in CAMERAS]
    found = estimate_pictured_depth((views[0], views[1]), (CAMERAS[0], CAMERAS[1]), DENSITY)
    assert found is not None
    assert found.is_other
    assert found.behind_m == pytest.approx(behind, abs=1.0)


def test_two_pictures_of_the_wall_agree_on_it() -> None:
    views = [seen_wall(camera) for camera in CAMERAS]
    found = estimate_pictured_depth((views[0], views[1]), (CAMERAS[0], CAMERAS[1]), DENSITY)
    assert found is not None
    assert found.is_own
    assert not found.is_other
    near = CAMERAS[0]._replace(right=3.5)
    assert estimate_pictured_depth((views[0], views[0]), (CAMERAS[0], near), DENSITY) is None, "no baseline"


def test_each_picture_has_its_reason() -> None:
    right, turned = seen_wall(CAMERAS[0]), seen_wall(CAMERAS[1], turn_deg=25.0)
    assert explain_other_planes([right, turned], CAMERAS, DENSITY) == ["", "turned by 25 degrees"]
    behind = [seen_wall(camera, behind=6.0) for camera in CAMERAS]
    reasons = explain_other_planes(behind, CAMERAS, DENSITY)
    assert [reason.endswith("m behind it, as two pictures agree") for reason in reasons] == [True, True]
