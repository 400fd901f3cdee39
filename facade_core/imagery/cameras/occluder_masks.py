"""What stands before a panorama: people, cars, plants and the like, by the parser that looks at facades."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from facade_core.core.labels import FacadeClass
from facade_core.core.types import Pose
from facade_core.geometry.equirectangular import basis
from facade_core.geometry.raycast import MISS
from facade_core.geometry.scene import Scene
from facade_core.imagery.poses.panorama_camera import camera_from_world, position
from facade_core.parsing.segmenter import parse

# Ordinary pictures that the parser looks at, around a panorama: it was taught on such, and bent lines are strange to it. Their
# number, width and height in degrees, how far down they look, and their side in pixels.
VIEWS, WIDE_DEG, DOWN_DEG, SIDE = 6, 75.0, 12.0, 480
# Degrees above and below the horizon between which the ground is looked for: steeper the camera's own vehicle is in the way.
HIGHEST_DEG, LOWEST_DEG = 2.0, 48.0
# Likewise walls and roofs, and how far up the other views look.
ROOFS_DEG, FEET_DEG, UP_DEG = 66.0, 30.0, 32.0
# Pixels to a degree of the mask.
FINE = 4
# What is smaller on a view is none, pixels.
LEAST = 100
# Degrees around a thing that hide too: feet, wheels and shadows reach beyond what the parser sees.
RIM_DEG = 1.25
# Degrees around the model's edges: at 15 m .07 m, twice as far as refined poses are off; flat roofs seen from a street have
# hardly more.
EDGE_DEG = 0.25


def mask_ground_occluders(image: np.ndarray, pose: Pose) -> np.ndarray:
    """Where a panorama shows something that stands on the ground, (H, W) bool.

    image (H, W, 3) uint8 is the part pose.view of the full panorama. Six views around the camera are parsed; a thing that any
    of them shows counts.
    """
    return _around(image, pose, (DOWN_DEG,), (HIGHEST_DEG, LOWEST_DEG))


def mask_building_occluders(image: np.ndarray, pose: Pose) -> np.ndarray:
    """Where a panorama shows something that stands before walls and roofs, or the sky beside them, (H, W) bool; six more views
    look up."""
    return _around(image, pose, (DOWN_DEG, -UP_DEG), (ROOFS_DEG, FEET_DEG), sky=True)


def mask_model_edges(scene: Scene, pose: Pose, shape: tuple[int, int]) -> np.ndarray:
    """Where a panorama of so many pixels (H, W) may show what lies beside a surface, for its pose is off by a little: bool, so
    far around the edges of all surfaces as the model has them; and where `mask_building_occluders` does not look."""
    import cv2

    rays = _degrees(ROOFS_DEG, FEET_DEG)
    _, hit = scene.caster.cast(position(pose), rays @ camera_from_world(pose))
    surface = np.where(hit == MISS, -1, scene.charts.surface[hit]).astype(np.float32)
    side = np.ones((2 * round(EDGE_DEG * FINE) + 1,) * 2, np.uint8)
    around = cv2.copyMakeBorder(surface, 0, 0, len(side), len(side), cv2.BORDER_WRAP)
    edge = (cv2.dilate(around, side) != cv2.erode(around, side))[:, len(side) : -len(side)]
    return _on_picture(edge, shape, pose, ROOFS_DEG, beyond=True)


def _degrees(highest: float, lowest: float) -> np.ndarray:
    """Rays (h, w, 3) float64 of a camera, FINE a degree, from so far above the horizon to so far below it."""
    rows = np.arange(round(-highest * FINE), round(lowest * FINE)) + 0.5
    latitude = -np.radians(rows / FINE)[:, None]
    longitude = np.radians((np.arange(360 * FINE) + 0.5) / FINE - 180)[None]
    ray = np.stack(np.broadcast_arrays(np.sin(longitude) * np.cos(latitude), -np.sin(latitude)), axis=-1)
    return np.concatenate([ray, (np.cos(longitude) * np.cos(latitude))[..., None]], axis=-1)


def _around(
    image: np.ndarray,
    pose: Pose,
    tilts: Sequence[float],
    reach: tuple[float, float],
    *,
    sky: bool = False,
) -> np.ndarray:
    """What stands in the way (H, W) bool with a rim, and the sky without, where that is asked for; as views tell that look down
    by `tilts`, in degrees, from so far above the horizon to so far below."""
    import cv2
    from skimage.morphology import remove_small_objects

    ray = _degrees(*reach)
    found, beyond = np.zeros(ray.shape[:2], bool), np.zeros(ray.shape[:2], bool)
    focal = SIDE / 2 / np.tan(np.radians(WIDE_DEG / 2))
    for down, view in product(tilts, range(VIEWS)):
        turn = _turned(2 * np.pi * view / VIEWS, np.radians(down))
        picture, shown = _perspective(image, pose, turn, focal)
        if not shown.any():
            continue
        parsing = parse(np.dstack([picture, np.where(shown, 255, 0).astype(np.uint8)]))
        right, below, ahead = np.moveaxis(ray @ turn.T, -1, 0)
        safe = np.maximum(ahead, 1e-6)
        x, y = (np.floor(focal * side / safe + SIDE / 2) for side in (right, below))
        inside = (ahead > 0) & (x >= 0) & (x < SIDE) & (y >= 0) & (y < SIDE)
        at = (y[inside].astype(np.intp), x[inside].astype(np.intp))
        found[inside] |= remove_small_objects(parsing.occluded & shown, max_size=LEAST)[at]
        if sky:
            beyond[inside] |= ((parsing.labels == FacadeClass.SKY) & shown)[at]
    rim = 2 * round(RIM_DEG * FINE) + 1
    around = np.pad(found, ((0, 0), (rim, rim)), mode="wrap").astype(np.uint8)
    found = cv2.dilate(around, np.ones((rim, rim), np.uint8))[:, rim:-rim] > 0
    return _on_picture(found | beyond, image.shape[:2], pose, reach[0])


def _turned(heading: float, down: float) -> np.ndarray:
    """Rotation (3, 3) from a panorama's camera to a view that is turned to its right and looks down."""
    forward = np.array([np.sin(heading), np.cos(heading)])
    # world axes are the panorama's: right, ahead, up
    level = basis(forward) @ np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    tilt = np.array([[1, 0, 0], [0, np.cos(down), -np.sin(down)], [0, np.sin(down), np.cos(down)]])
    return tilt @ level


def _perspective(image: np.ndarray, pose: Pose, turn: np.ndarray, focal: float) -> tuple[np.ndarray, np.ndarray]:
    """An ordinary picture (SIDE, SIDE, 3) uint8 out of a panorama, and where the panorama's part holds it (SIDE, SIDE) bool."""
    import cv2

    x, y = np.meshgrid((np.arange(SIDE) + 0.5 - SIDE / 2) / focal, (np.arange(SIDE) + 0.5 - SIDE / 2) / focal)
    right, down, ahead = np.moveaxis(np.stack([x, y, np.ones_like(x)], axis=-1) @ turn, -1, 0)
    left, top, wide, high = pose.view
    across = np.arctan2(right, ahead) / (2 * np.pi) + 0.5
    along = 0.5 + np.arctan2(down, np.hypot(right, ahead)) / np.pi
    column, row = (across - left) % 1.0 / wide, (along - top) / high
    shown = (column < 1) & (row >= 0) & (row < 1)
    # as many pixels as the views have: of a larger panorama means are taken, or its noise would be looked at
    small = image
    if (finer := image.shape[1] / wide / (2 * np.pi * focal)) > 2:
        size = (round(image.shape[1] / finer), round(image.shape[0] / finer))
        small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    at = ((column * small.shape[1] - 0.5).astype(np.float32), (row * small.shape[0] - 0.5).astype(np.float32))
    picture = cv2.remap(small, *at, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.where(shown[..., None], picture, 0).astype(np.uint8), shown


def _on_picture(
    found: np.ndarray, shape: tuple[int, int], pose: Pose, highest: float, *, beyond: bool = False
) -> np.ndarray:
    """A mask over degrees, from so many above the horizon on, on the pixels (H, W) of a picture; `beyond` above and below."""
    height, width = shape
    left, top, wide, high = pose.view
    column = (np.floor(((np.arange(width) + 0.5) / width * wide + left) * 360 * FINE) % (360 * FINE)).astype(np.intp)
    degrees = ((np.arange(height) + 0.5) / height * high + top - 0.5) * 180
    row = np.floor((degrees + highest) * FINE).astype(np.intp)
    inside = (row >= 0) & (row < len(found))
    mask = np.full(shape, beyond)
    mask[inside] = found[row[inside]][:, column]
    return mask
