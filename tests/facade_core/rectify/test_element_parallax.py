"""Depths of painted elements, measured from two pictures of their wall."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from facade_core.core.types import Element
from facade_core.imagery.rectify.element_parallax import GreyView, group_elements, measure_element_depths
from facade_core.imagery.rectify.pictured_plane import CameraFrame

DENSITY, WIDTH_M, HEIGHT_M = 30.0, 12.0, 8.0
CAMERAS = (CameraFrame(3.0, 6.5, 9.0), CameraFrame(7.0, 6.5, 9.0))
WINDOWS = [
    Element("window", 1.0 + 2.0 * column, 1.0 + 3.0 * floor, 2.4 + 2.0 * column, 2.8 + 3.0 * floor)
    for floor in range(2)
    for column in range(5)
]


def paint_texture(shape: tuple[int, int], seed: int) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(0, 1, shape).astype(np.float32)
    return 128 + 220 * cv2.GaussianBlur(noise, (0, 0), 3)


def seen_from(camera: CameraFrame, elements: list[Element], depth: float) -> GreyView:
    """Render a wall whose elements have a depth as a camera shows it, rectified on the wall."""
    size = (round(HEIGHT_M * DENSITY), round(WIDTH_M * DENSITY))
    wall, deep = paint_texture(size, 1), paint_texture(size, 2)
    columns, rows = np.meshgrid(np.arange(size[1]) + 0.5, np.arange(size[0]) + 0.5)
    x, y = columns / DENSITY, rows / DENSITY
    share = (camera.before - depth) / camera.before
    there_x, there_y = camera.right + (x - camera.right) * share, camera.down + (y - camera.down) * share
    at = [(side * DENSITY - 0.5).astype(np.float32) for side in (there_x, there_y)]
    shown = cv2.remap(deep, at[0], at[1], cv2.INTER_LINEAR)
    image = wall.copy()
    for e in elements:
        inside_wall = (x > e.x0) & (x < e.x1) & (y > e.y0) & (y < e.y1)
        inside = (there_x > e.x0) & (there_x < e.x1) & (there_y > e.y0) & (there_y < e.y1)
        is_shown = inside & inside_wall if depth < 0 else inside
        image[inside_wall] = 60
        image[is_shown] = shown[is_shown]
    return GreyView(np.clip(image, 1, 255).astype(np.uint8), camera)


@pytest.mark.parametrize("depth", [-0.4, -0.12, 0.0])
def test_depth_of_windows_is_measured(depth: float) -> None:
    views = [seen_from(camera, WINDOWS, depth) for camera in CAMERAS]
    (found,) = measure_element_depths(WINDOWS, views, np.zeros(len(WINDOWS), int), DENSITY)
    assert found.is_reliable
    assert found.outward_m == pytest.approx(depth, abs=0.02)
    assert found.members == tuple(range(len(WINDOWS)))


def test_depth_is_relative_to_the_pictured_wall() -> None:
    """A pose that is off moves wall and windows alike."""
    views = [seen_from(camera, WINDOWS, -0.3) for camera in CAMERAS]
    moved = GreyView(views[1].grey, CAMERAS[1]._replace(right=CAMERAS[1].right + 0.1))
    rolled = GreyView(np.roll(moved.grey, 3, axis=1), moved.camera)
    (found,) = measure_element_depths(WINDOWS, [views[0], rolled], np.zeros(len(WINDOWS), int), DENSITY)
    assert found.is_reliable
    assert found.outward_m == pytest.approx(-0.3, abs=0.02)


def test_depth_of_balconies_is_measured() -> None:
    balconies = [Element("balcony", 1.0 + 4.0 * k, 3.0, 3.4 + 4.0 * k, 4.2) for k in range(3)]
    views = [seen_from(camera, balconies, 0.8) for camera in CAMERAS]
    scale = CAMERAS[0].before / (CAMERAS[0].before - 0.8)
    boxes = [
        Element(
            "balcony",
            *(CAMERAS[0].right + (e.x0 - CAMERAS[0].right) * scale, CAMERAS[0].down + (e.y0 - CAMERAS[0].down) * scale),
            *(CAMERAS[0].right + (e.x1 - CAMERAS[0].right) * scale, CAMERAS[0].down + (e.y1 - CAMERAS[0].down) * scale),
        )
        for e in balconies
    ]
    (found,) = measure_element_depths(boxes, views, np.zeros(3, int), DENSITY)
    assert found.is_reliable
    assert found.outward_m == pytest.approx(0.8, abs=0.03)


def test_nothing_is_measured_from_one_place_or_by_different_pictures() -> None:
    one = seen_from(CAMERAS[0], WINDOWS, -0.3)
    assert not measure_element_depths(WINDOWS, [one, one], np.zeros(len(WINDOWS), int), DENSITY)
    other = GreyView(np.clip(paint_texture(one.grey.shape, 9), 1, 255).astype(np.uint8), CAMERAS[1])
    assert not measure_element_depths(WINDOWS, [one, other], np.zeros(len(WINDOWS), int), DENSITY)
    hidden = GreyView(np.zeros_like(one.grey), CAMERAS[1])
    assert not measure_element_depths(WINDOWS, [one, hidden], np.zeros(len(WINDOWS), int), DENSITY)


def test_small_types_join_the_largest_of_their_class() -> None:
    odd = Element("window", 11.0, 1.0, 11.3, 1.4)
    door = Element("door", 5.0, 5.0, 6.0, 8.0)
    assert group_elements([*WINDOWS, odd, door]) == [(11,), tuple(range(11))]
