"""Occluders in panoramas and pictures of a lens (people, cars, plants), found by the facade parser."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, UInt8Array
from facade_core.core.fixed_order import multiply_matrices
from facade_core.core.labels import FacadeClass
from facade_core.core.lens_projection import picture_rays
from facade_core.core.types import Pose
from facade_core.geometry.equirectangular import upright_rotation
from facade_core.geometry.raycast import MISS
from facade_core.geometry.scene import Scene
from facade_core.imagery.cameras.settings import OCCLUDERS
from facade_core.imagery.panorama_camera import camera_from_world, camera_position, pixels_per_radian
from facade_core.parsing.segmenter import parse


def mask_ground_occluders(image: UInt8Array, pose: Pose) -> BoolArray:
    """Mask occluders of the ground in a panorama, or in a picture of a lens, which is parsed as it is.

    Six views around the camera are parsed. An object that any of them shows counts.

    Parameters
    ----------
    image : (H, W, 3) uint8, the part `pose.view` of the full panorama.
    pose : pose of the camera.

    Returns
    -------
    (H, W) bool.
    """
    if pose.lens is not None:
        return _mask_picture_occluders(image, pose)
    return _mask_occluders(
        image, pose, (OCCLUDERS.downward_tilt_deg,), (OCCLUDERS.ground_top_deg, OCCLUDERS.ground_bottom_deg)
    )


def mask_building_occluders(image: UInt8Array, pose: Pose) -> BoolArray:
    """Mask occluders of walls and roofs, and the sky, in a panorama or a picture of a lens.

    Parses six more views than `mask_ground_occluders`, which look up.

    Parameters
    ----------
    image : (H, W, 3) uint8, the part `pose.view` of the full panorama.
    pose : pose of the camera.

    Returns
    -------
    (H, W) bool.
    """
    if pose.lens is not None:
        return _mask_picture_occluders(image, pose, sky=True)
    return _mask_occluders(
        image,
        pose,
        (OCCLUDERS.downward_tilt_deg, -OCCLUDERS.upward_tilt_deg),
        (OCCLUDERS.building_top_deg, OCCLUDERS.building_bottom_deg),
        sky=True,
    )


def mask_model_edges(scene: Scene, pose: Pose, shape: tuple[int, int]) -> BoolArray:
    """Mask a rim around the model's edges, where a small pose error shows the wrong surface.

    Pixels of a panorama outside the part that `mask_building_occluders` covers are masked too.

    Parameters
    ----------
    scene : scene whose surfaces are projected.
    pose : pose of the camera.
    shape : height and width of the panorama in pixels.

    Returns
    -------
    (H, W) bool.
    """
    import cv2

    side = np.ones((2 * round(OCCLUDERS.edge_rim_deg * OCCLUDERS.pixels_per_degree) + 1,) * 2, np.uint8)
    if pose.lens is not None:
        size = _shrunken_size(pose, shape, np.degrees(OCCLUDERS.pixels_per_degree))
        ray = picture_rays(pose.lens, size)
        is_shown: BoolArray = np.asarray(np.isfinite(ray).all(axis=-1))
        surface = _seen_surfaces(scene, pose, np.where(is_shown[..., None], ray, [0.0, 0.0, 1.0]))
        edge = _changes_within(surface, side) | ~is_shown
        return np.asarray(cv2.resize(edge.astype(np.uint8), shape[::-1], interpolation=cv2.INTER_NEAREST) > 0)
    surface = _seen_surfaces(scene, pose, _ray_grid(OCCLUDERS.building_top_deg, OCCLUDERS.building_bottom_deg))
    around = cv2.copyMakeBorder(surface, 0, 0, len(side), len(side), cv2.BORDER_WRAP)
    edge = _changes_within(np.asarray(around, np.float32), side)[:, len(side) : -len(side)]
    return _project_to_picture(edge, shape, pose, OCCLUDERS.building_top_deg, fill=True)


def _changes_within(surface: Float32Array, side: UInt8Array) -> BoolArray:
    """Pixels (h, w) bool beside which, within a square `side`, another surface is."""
    import cv2

    changes: BoolArray = np.not_equal(cv2.dilate(surface, side), cv2.erode(surface, side))
    return changes


def _seen_surfaces(scene: Scene, pose: Pose, rays: Float64Array) -> Float32Array:
    """Surface that each camera ray (h, w, 3) meets, -1 for none: (h, w) float32."""
    _, hit = scene.caster.cast(camera_position(pose), multiply_matrices(rays, camera_from_world(pose)))
    return np.where(hit == MISS, -1, scene.charts.surface[hit]).astype(np.float32)


def _shrunken_size(pose: Pose, shape: tuple[int, ...], resolution: float) -> tuple[int, int]:
    """Rows and columns of a picture of a lens at so many pixels per radian, or of the picture if it is coarser."""
    shrink = min(1.0, resolution / pixels_per_radian(pose, shape[1]))
    return max(1, round(shape[0] * shrink)), max(1, round(shape[1] * shrink))


def _mask_picture_occluders(image: UInt8Array, pose: Pose, *, sky: bool = False) -> BoolArray:
    """Occluders with a rim, and optionally the sky, in a picture of a lens at the scale of a view: (H, W) bool.

    None in an aerial picture: the parser takes roofs from above for what stands before a facade.
    """
    import cv2
    from skimage.morphology import remove_small_objects

    if pose.is_aerial:
        return np.zeros(image.shape[:2], bool)
    focal = OCCLUDERS.view_side / 2 / np.tan(np.radians(OCCLUDERS.view_width_deg / 2))
    size = _shrunken_size(pose, image.shape, focal)
    parsing = parse(np.asarray(cv2.resize(image, size[::-1], interpolation=cv2.INTER_AREA), np.uint8))
    is_occluder = remove_small_objects(parsing.occluded, max_size=OCCLUDERS.min_occluder_pixels).astype(np.uint8)
    rim = 2 * round(np.radians(OCCLUDERS.occluder_rim_deg) * pixels_per_radian(pose, size[1])) + 1
    hidden = cv2.dilate(is_occluder, np.ones((rim, rim), np.uint8)) > 0
    if sky:
        hidden |= parsing.labels == FacadeClass.SKY
    shape = (image.shape[1], image.shape[0])
    return np.asarray(cv2.resize(hidden.astype(np.uint8), shape, interpolation=cv2.INTER_NEAREST) > 0)


def _ray_grid(top_deg: float, bottom_deg: float) -> Float64Array:
    """Camera rays (h, w, 3) float64 at pixels_per_degree, from top_deg above the horizon to bottom_deg below it."""
    rows = (
        np.arange(round(-top_deg * OCCLUDERS.pixels_per_degree), round(bottom_deg * OCCLUDERS.pixels_per_degree)) + 0.5
    )
    latitude = -np.radians(rows / OCCLUDERS.pixels_per_degree)[:, None]
    longitude = np.radians((np.arange(360 * OCCLUDERS.pixels_per_degree) + 0.5) / OCCLUDERS.pixels_per_degree - 180)[
        None
    ]
    ray = np.stack(np.broadcast_arrays(np.sin(longitude) * np.cos(latitude), -np.sin(latitude)), axis=-1)
    return np.concatenate([ray, (np.cos(longitude) * np.cos(latitude))[..., None]], axis=-1)


def _mask_occluders(
    image: UInt8Array,
    pose: Pose,
    tilts: Sequence[float],
    elevation_range: tuple[float, float],
    *,
    sky: bool = False,
) -> BoolArray:
    """Occluders with a rim, and optionally the sky, from views tilted down by `tilts` degrees: (H, W) bool.

    elevation_range : degrees above and below the horizon that are searched.
    """
    import cv2
    from skimage.morphology import remove_small_objects

    ray = _ray_grid(*elevation_range)
    is_occluder, is_sky = np.zeros(ray.shape[:2], bool), np.zeros(ray.shape[:2], bool)
    focal = OCCLUDERS.view_side / 2 / np.tan(np.radians(OCCLUDERS.view_width_deg / 2))
    for down, view in product(tilts, range(OCCLUDERS.view_count)):
        rotation = _view_rotation(2 * np.pi * view / OCCLUDERS.view_count, np.radians(down))
        picture, is_shown = _render_view(image, pose, rotation, focal)
        if not is_shown.any():
            continue
        parsing = parse(np.dstack([picture, np.where(is_shown, 255, 0).astype(np.uint8)]))
        right, below, ahead = np.moveaxis(multiply_matrices(ray, rotation.T), -1, 0)
        safe = np.maximum(ahead, 1e-6)
        x, y = (np.floor(focal * side / safe + OCCLUDERS.view_side / 2) for side in (right, below))
        inside = (ahead > 0) & (x >= 0) & (x < OCCLUDERS.view_side) & (y >= 0) & (y < OCCLUDERS.view_side)
        pixel = (y[inside].astype(np.intp), x[inside].astype(np.intp))
        is_occluder[inside] |= remove_small_objects(
            parsing.occluded & is_shown, max_size=OCCLUDERS.min_occluder_pixels
        )[pixel]
        if sky:
            is_sky[inside] |= ((parsing.labels == FacadeClass.SKY) & is_shown)[pixel]
    rim = 2 * round(OCCLUDERS.occluder_rim_deg * OCCLUDERS.pixels_per_degree) + 1
    around = np.pad(is_occluder, ((0, 0), (rim, rim)), mode="wrap").astype(np.uint8)
    is_occluder = cv2.dilate(around, np.ones((rim, rim), np.uint8))[:, rim:-rim] > 0
    return _project_to_picture(is_occluder | is_sky, image.shape[:2], pose, elevation_range[0])


def _view_rotation(heading: float, down: float) -> Float64Array:
    """Rotation (3, 3) from the panorama's camera to a view turned to its right and tilted down."""
    forward = np.array([np.sin(heading), np.cos(heading)])
    # `basis` expects world axes: right, ahead, up
    level = multiply_matrices(upright_rotation(forward), np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]))
    tilt = np.array([[1, 0, 0], [0, np.cos(down), -np.sin(down)], [0, np.sin(down), np.cos(down)]])
    return multiply_matrices(tilt, level)


def _render_view(image: UInt8Array, pose: Pose, rotation: Float64Array, focal: float) -> tuple[UInt8Array, BoolArray]:
    """Perspective view (view_side, view_side, 3) uint8 of a panorama, and where the panorama covers it, bool."""
    import cv2

    x, y = np.meshgrid(
        (np.arange(OCCLUDERS.view_side) + 0.5 - OCCLUDERS.view_side / 2) / focal,
        (np.arange(OCCLUDERS.view_side) + 0.5 - OCCLUDERS.view_side / 2) / focal,
    )
    right, down, ahead = np.moveaxis(multiply_matrices(np.stack([x, y, np.ones_like(x)], axis=-1), rotation), -1, 0)
    left, top, wide, high = pose.view
    across = np.arctan2(right, ahead) / (2 * np.pi) + 0.5
    along = 0.5 + np.arctan2(down, np.hypot(right, ahead)) / np.pi
    column, row = (across - left) % 1.0 / wide, (along - top) / high
    is_shown = (column < 1) & (row >= 0) & (row < 1)
    # area means of larger panoramas: without them the parser would see pixel noise
    small = image
    if (finer := image.shape[1] / wide / (2 * np.pi * focal)) > 2:
        size = (round(image.shape[1] / finer), round(image.shape[0] / finer))
        small = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
    at = ((column * small.shape[1] - 0.5).astype(np.float32), (row * small.shape[0] - 0.5).astype(np.float32))
    picture = cv2.remap(small, *at, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.where(is_shown[..., None], picture, 0).astype(np.uint8), is_shown


def _project_to_picture(
    mask_by_angle: BoolArray, shape: tuple[int, int], pose: Pose, top_deg: float, *, fill: bool = False
) -> BoolArray:
    """Resample a mask over angles, which begins at top_deg, to pixels (H, W); `fill` above and below it."""
    height, width = shape
    left, top, wide, high = pose.view
    column = (
        np.floor(((np.arange(width) + 0.5) / width * wide + left) * 360 * OCCLUDERS.pixels_per_degree)
        % (360 * OCCLUDERS.pixels_per_degree)
    ).astype(np.intp)
    degrees = ((np.arange(height) + 0.5) / height * high + top - 0.5) * 180
    row = np.floor((degrees + top_deg) * OCCLUDERS.pixels_per_degree).astype(np.intp)
    inside = (row >= 0) & (row < len(mask_by_angle))
    mask = np.full(shape, fill)
    mask[inside] = mask_by_angle[row[inside]][:, column]
    return mask
