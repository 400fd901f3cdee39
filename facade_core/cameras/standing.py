"""What stands on the ground before a panorama: people, cars, plants and the like, by the parser that looks at facades."""

from __future__ import annotations

import numpy as np

from facade_core.geometry.equirectangular import basis
from facade_core.parse import parse
from facade_core.types import Pose

# Ordinary pictures that the parser looks at, around a panorama: it was taught on such, and bent lines are strange to it. Their
# number, width and height in degrees, how far down they look, and their side in pixels.
VIEWS, WIDE_DEG, DOWN_DEG, SIDE = 6, 75.0, 12.0, 480
# Degrees above and below the horizon between which the ground is looked for: steeper the camera's own vehicle is in the way.
HIGHEST_DEG, LOWEST_DEG = 2.0, 48.0
# Pixels to a degree of the mask.
FINE = 4
# What is smaller on a view is none, pixels.
LEAST = 100
# Degrees around a thing that hide too: feet, wheels and shadows reach beyond what the parser sees.
RIM_DEG = 1.25


def in_the_way(image: np.ndarray, pose: Pose) -> np.ndarray:
    """Where a panorama shows something that stands on the ground, (H, W) bool.

    image (H, W, 3) uint8 is the part pose.view of the full panorama. Six views around the camera are parsed; a thing that any
    of them shows counts.
    """
    import cv2
    from skimage.morphology import remove_small_objects

    rows = np.arange(round(-HIGHEST_DEG * FINE), round(LOWEST_DEG * FINE)) + 0.5
    columns = np.arange(360 * FINE) + 0.5
    latitude = -np.radians(rows / FINE)[:, None]
    longitude = np.radians(columns / FINE - 180)[None]
    ray = np.stack(np.broadcast_arrays(np.sin(longitude) * np.cos(latitude), -np.sin(latitude)), axis=-1)
    ray = np.concatenate([ray, (np.cos(longitude) * np.cos(latitude))[..., None]], axis=-1)
    found = np.zeros(ray.shape[:2], bool)
    focal = SIDE / 2 / np.tan(np.radians(WIDE_DEG / 2))
    for view in range(VIEWS):
        turn = _turned(2 * np.pi * view / VIEWS, np.radians(DOWN_DEG))
        picture, shown = _perspective(image, pose, turn, focal)
        if not shown.any():
            continue
        alpha = np.where(shown, 255, 0).astype(np.uint8)
        things = remove_small_objects(parse(np.dstack([picture, alpha])).occluded & shown, max_size=LEAST)
        right, down, ahead = np.moveaxis(ray @ turn.T, -1, 0)
        safe = np.maximum(ahead, 1e-6)
        x, y = (np.floor(focal * side / safe + SIDE / 2) for side in (right, down))
        inside = (ahead > 0) & (x >= 0) & (x < SIDE) & (y >= 0) & (y < SIDE)
        found[inside] |= things[y[inside].astype(np.intp), x[inside].astype(np.intp)]
    rim = 2 * round(RIM_DEG * FINE) + 1
    around = np.pad(found, ((0, 0), (rim, rim)), mode="wrap").astype(np.uint8)
    found = cv2.dilate(around, np.ones((rim, rim), np.uint8))[:, rim:-rim] > 0
    return _on_picture(found, image.shape[:2], pose)


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


def _on_picture(found: np.ndarray, shape: tuple[int, int], pose: Pose) -> np.ndarray:
    """A mask over degrees, as `in_the_way` makes it, on the pixels (H, W) of a picture."""
    height, width = shape
    left, top, wide, high = pose.view
    column = (np.floor(((np.arange(width) + 0.5) / width * wide + left) * 360 * FINE) % (360 * FINE)).astype(np.intp)
    degrees = ((np.arange(height) + 0.5) / height * high + top - 0.5) * 180
    row = np.floor((degrees + HIGHEST_DEG) * FINE).astype(np.intp)
    inside = (row >= 0) & (row < len(found))
    mask = np.zeros(shape, bool)
    mask[inside] = found[row[inside]][:, column]
    return mask
