"""Common exposure of a block's panoramas: factors per camera and channel from ground that neighbours share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, UInt8Array
from facade_core.core.types import Pose
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.raycast import MISS
from facade_core.geometry.scene import Scene
from facade_core.imagery.cameras.settings import EXPOSURE
from facade_core.imagery.panorama_camera import (
    camera_position,
    is_in_view,
    pixels_per_radian,
    project_directions_to_picture,
)


class GroundColourSamples(NamedTuple):
    """Colours of ground squares around one camera, and the camera's height.

    Attributes
    ----------
    height : height of the camera above the ground in metres, None without ground below.
    squares : (n, 5) integers: east and north of the square in grid_square_m, then its red, green and blue.
    """

    height: float | None
    squares: list[list[int]]


def sample_ground_colours(scene: Scene, image: UInt8Array, pose: Pose) -> GroundColourSamples:
    """Sample the ground around a panorama by squares of the world grid.

    Each square has the median colour of its samples in sight.

    Parameters
    ----------
    image : (H, W, 3) uint8, the part `pose.view` of the full panorama.
    pose : pose of the camera.

    Returns
    -------
    Height of the camera and colours of the squares.

    Raises
    ------
    GeometryError
        If the pose has no height.
    """
    import cv2

    centre = camera_position(pose)
    below, chart = scene.caster.cast(centre, np.array([[0.0, 0.0, -1.0]]))
    if chart[0] == MISS or scene.charts.kind[chart[0]] != ChartKind.GROUND:
        return GroundColourSamples(None, [])
    latitude = np.radians(-np.linspace(EXPOSURE.min_depression_deg, EXPOSURE.max_depression_deg, EXPOSURE.ray_rows))[
        :, None
    ]
    longitude = (np.arange(EXPOSURE.rays_per_turn) + 0.5)[None] / EXPOSURE.rays_per_turn * 2 * np.pi
    rays = np.stack(
        [
            np.sin(longitude) * np.cos(latitude),
            np.cos(longitude) * np.cos(latitude),
            np.broadcast_to(np.sin(latitude), (EXPOSURE.ray_rows, EXPOSURE.rays_per_turn)),
        ],
        axis=-1,
    ).reshape(-1, 3)
    depth, hit = scene.caster.cast(centre, rays)
    distance = depth * np.hypot(rays[:, 0], rays[:, 1])
    share = project_directions_to_picture(rays, pose)
    usable = (
        (hit != MISS)
        & (distance >= EXPOSURE.min_sample_distance_m)
        & (distance <= EXPOSURE.max_sample_distance_m)
        & is_in_view(share, pose)
    )
    usable[usable] = scene.charts.kind[hit[usable]] == ChartKind.GROUND
    if not usable.any():
        return GroundColourSamples(round(float(below[0]), 3), [])
    left, top, wide, high = pose.view
    columns, rows = max(1, round(2 * EXPOSURE.rays_per_turn * wide)), max(1, round(EXPOSURE.rays_per_turn * high))
    if pose.lens is not None:  # as sharp on the axis
        shrink = min(1.0, 2 * EXPOSURE.rays_per_turn / (2 * np.pi) / pixels_per_radian(pose, image.shape[1]))
        columns, rows = (max(1, round(side * shrink)) for side in (image.shape[1], image.shape[0]))
    small = cv2.resize(image, (columns, rows), interpolation=cv2.INTER_AREA)
    column = ((share[usable, 0] - left) % 1.0 / wide * columns).astype(np.intp).clip(max=columns - 1)
    row = ((share[usable, 1] - top) / high * len(small)).astype(np.intp).clip(0, len(small) - 1)
    colour = small[row, column]
    points = centre[:2] + (depth[usable, None] * rays[usable])[:, :2]
    square, square_index = np.unique(
        np.floor(points / EXPOSURE.grid_square_m).astype(np.int64), axis=0, return_inverse=True
    )
    square_index = square_index.reshape(-1)
    squares = []
    for index, (east, north) in enumerate(square.tolist()):
        samples = colour[square_index == index]
        if len(samples) >= EXPOSURE.min_square_samples:
            squares.append([east, north, *np.round(np.median(samples, axis=0)).astype(int).tolist()])
    return GroundColourSamples(round(float(below[0]), 3), squares)


class CommonExposure(NamedTuple):
    """Factors that bring n cameras to one exposure and white balance.

    Attributes
    ----------
    factors : (n, 3) factors per camera and channel; 1 of a camera that shares no ground.
    is_shared : (n,) bool, the camera shares ground with another.
    """

    factors: Float64Array
    is_shared: BoolArray


def estimate_common_exposure(squares_by_camera: Sequence[Sequence[Sequence[int]]]) -> CommonExposure:
    """Estimate the factors that bring cameras to one exposure and white balance.

    Least squares over the pairs that share squares. The ratio of a pair is a median, and the mean factor is one.
    A camera that shares nothing keeps its colours.

    Parameters
    ----------
    squares_by_camera : squares of each of n cameras, see `GroundColourSamples`.

    """
    n = len(squares_by_camera)
    is_shared = np.zeros(n, bool)
    colours = [{(one[0], one[1]): one[2:] for one in squares if _is_exposed(one[2:])} for squares in squares_by_camera]
    cameras_by_square: dict[tuple[int, int], list[int]] = {}
    for camera, squares in enumerate(colours):
        for square in squares:
            cameras_by_square.setdefault(square, []).append(camera)
    pairs = sorted({(i, j) for cameras in cameras_by_square.values() for i in cameras for j in cameras if i < j})
    equations, ratios = [], []
    for i, j in pairs:
        shared = sorted(colours[i].keys() & colours[j].keys())
        if len(shared) >= EXPOSURE.min_shared_squares:
            both = np.array([[colours[one][square] for square in shared] for one in (i, j)], np.float64)
            weight = np.sqrt(len(shared))
            equations.append((i, j, weight))
            is_shared[[i, j]] = True
            ratios.append(weight * np.median(np.log(both[1] / both[0]), axis=0))
    if not equations:
        return CommonExposure(np.ones((n, 3)), is_shared)
    from scipy.sparse import coo_array, vstack
    from scipy.sparse.linalg import spsolve

    first, second, weight = (np.array(column) for column in zip(*equations, strict=True))
    row = np.arange(len(equations))
    matrix = coo_array(
        (np.concatenate([weight, -weight]), (np.tile(row, 2), np.concatenate([first, second]))), (len(row), n)
    )
    damping = coo_array((np.full(n, EXPOSURE.factor_damping), (np.arange(n), np.arange(n))), (n, n))
    system = vstack([matrix, damping]).tocsc()
    right = np.vstack([*ratios, np.zeros((n, 3))])
    solution = np.column_stack([spsolve((system.T @ system).tocsc(), system.T @ right[:, band]) for band in range(3)])
    factors: Float64Array = (
        np.round(
            np.exp(np.clip(solution, -np.log(EXPOSURE.max_factor), np.log(EXPOSURE.max_factor))) / EXPOSURE.factor_step
        )
        * EXPOSURE.factor_step
    )
    return CommonExposure(factors, is_shared)


def typical_ground_colour(squares: Sequence[Sequence[int]]) -> tuple[Float64Array, Float64Array] | None:
    """Return median and median absolute deviation of the ground's log colours.

    Parameters
    ----------
    squares : squares of one camera, see `GroundColourSamples`.

    Returns
    -------
    Two arrays (3,), None with too few well exposed squares.
    """
    colours = np.array([one[2:] for one in squares if _is_exposed(one[2:])], np.float64)
    if len(colours) < EXPOSURE.min_shared_squares:
        return None
    logs = np.log(colours)
    middle = np.median(logs, axis=0)
    return middle, np.median(np.abs(logs - middle), axis=0)


def _is_exposed(colour: Sequence[int]) -> bool:
    return min(colour) >= EXPOSURE.exposed_range[0] and max(colour) <= EXPOSURE.exposed_range[1]
