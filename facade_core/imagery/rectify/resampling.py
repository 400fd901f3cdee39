"""Resampling of panoramas and pictures of a lens to a chart's texels: the pixels that each texel covers, and their mean."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, Int64Array, UInt8Array
from facade_core.core.lens_projection import lens_array, project_ray
from facade_core.core.numba_cache import njit
from facade_core.core.types import Pose
from facade_core.imagery.panorama_camera import NO_TURN_PX, camera_from_world
from facade_core.imagery.rectify.area_means import build_pyramid, write_parallelogram_mean

# Colour distance to the bottom row within which pixels above belong to the same flat mask.
MASK_TOLERANCE = 12
# Rows above the mask that compression has mixed with it.
MASK_RIM_ROWS = 4
# A flat bottom above this share of the full panorama's height is ground, not a mask.
MASK_TOP_SHARE = 2 / 3


class ChartTexelGrid(NamedTuple):
    """Texel grid of a chart, relative to the camera.

    Attributes
    ----------
    corner : (3,) upper left corner.
    right : (3,) step from one texel to the next in a row.
    down : (3,) step from one row to the next.
    normal : (3,) normal of the chart.
    """

    corner: Float64Array
    right: Float64Array
    down: Float64Array
    normal: Float64Array


class PanoramaProjection(NamedTuple):
    """Projection of a panorama or a lens.

    Attributes
    ----------
    camera : (3, 3) rotation.
    turn : pixels per full turn, NO_TURN_PX of a lens.
    half : pixels per half turn, vertically.
    left : pixels of the full panorama left of the picture.
    top : pixels above it.
    height : height of the picture.
    width : width of the picture.
    lens : lens as `lens_array` gives it, empty for a panorama.
    """

    camera: Float64Array
    turn: float
    half: float
    left: float
    top: float
    height: int
    width: int
    lens: Float64Array


def picture_projection(pose: Pose, shape: tuple[int, ...]) -> PanoramaProjection:
    """Return the projection of a picture of a shape (rows, columns, ...)."""
    left, top, width, height = pose.view
    turn, half = shape[1] / width, shape[0] / height
    return PanoramaProjection(
        camera_from_world(pose),
        turn if pose.lens is None else NO_TURN_PX,
        half,
        left * turn,
        top * half,
        shape[0],
        shape[1],
        lens_array(pose.lens),
    )


def resample_panorama(image: UInt8Array, pose: Pose, footprints: Float32Array, seen: BoolArray) -> UInt8Array:
    """Resample a picture to the seen texels, and clear texels that the flat mask of a panorama hides.

    Parameters
    ----------
    image : (H, W, 3) uint8, of a panorama the part `pose.view`.
    pose : pose of the camera.
    footprints : (h, w, 6), see `compute_texel_footprints`.
    seen : (h, w) bool; changed in place.

    Returns
    -------
    (h, w, 3) uint8, black where not seen.
    """
    rgb = np.zeros((*seen.shape, 3), np.uint8)
    if not seen.any():
        return rgb
    used = footprints[seen]
    view = pose.view
    turn = image.shape[1] / view[2] if pose.lens is None else NO_TURN_PX
    margin = float(np.abs(used[:, 2:]).max()) + 3.0  # pixels around texel centres that are read
    first, columns = _needed_columns(used[:, 0], margin, image.shape[1], turn)
    upper = max(0, int(used[:, 1].min() - margin))
    lower = min(len(image), int(used[:, 1].max() + margin) + 1)
    highest = round((MASK_TOP_SHARE - view[1]) / view[3] * len(image)) if pose.lens is None else len(image)
    mask = _mask_top(image, columns, highest, lower)
    runs = np.split(columns, np.flatnonzero(np.diff(columns) != 1) + 1)  # slices are copied much faster than columns
    part = build_pyramid(np.concatenate([image[upper:lower, run[0] : run[-1] + 1] for run in runs], axis=1))
    _resample_texels(part.pixels, part.levels, footprints, float(first), turn, float(upper), mask, rgb, seen)
    return rgb


def _needed_columns(x: Float32Array, margin: float, width: int, turn: float) -> tuple[int, Int64Array]:
    """Return the first column and all columns of the picture that texels at x need.

    A full panorama continues across its border.
    """
    if turn > width:
        first = max(0, int(x.min() - margin))
        return first, np.arange(first, min(width, int(x.max() + margin) + 1))
    angle = x * (2 * np.pi / turn)
    middle = np.arctan2(np.sin(angle).mean(), np.cos(angle).mean()) * turn / (2 * np.pi)
    offset = (x - middle + turn / 2) % turn - turn / 2
    first = int(np.floor(middle + max(offset.min() - margin, -turn / 2)))
    last = int(np.ceil(middle + min(offset.max() + margin, turn / 2)))
    return first, np.arange(first, last + 1) % width


def _mask_top(image: UInt8Array, columns: Int64Array, highest: int, lower: int) -> Int64Array:
    """First row of the flat mask at the bottom of each column: one colour, which the whole bottom row has.

    Rows above `highest` are never masked. Rows from `lower` on are not needed.
    """
    none = np.full(len(columns), len(image))
    highest = max(highest, 0)
    if lower <= highest:
        return none
    bottom = image[-1].astype(np.int16)
    colour = np.median(bottom, axis=0)
    if (np.abs(bottom - colour).max(axis=1) > MASK_TOLERANCE).mean() > 0.05:
        return none
    low, high = (
        np.clip(colour - MASK_TOLERANCE, 0, 255).astype(np.uint8),
        np.clip(colour + MASK_TOLERANCE, 0, 255).astype(np.uint8),
    )
    part = image[highest:][::-1][:, columns]
    flat = ((part >= low) & (part <= high)).all(axis=2)
    run = np.where(flat.all(axis=0), len(flat), flat.argmin(axis=0))
    return np.where(run > 0, np.maximum(len(image) - run - MASK_RIM_ROWS, highest), none)


@njit(cache=True, nogil=True)
def compute_texel_footprints(
    raster: ChartTexelGrid,
    projection: PanoramaProjection,
    grazing: float,
    footprints: Float32Array,
    seen: BoolArray,
    quality: Float32Array,
) -> None:
    """Compute each texel's footprint in the picture, its visibility and its quality.

    Parameters
    ----------
    raster : texels of the chart.
    projection : projection of the picture.
    grazing : sine of the smallest viewing angle.
    footprints : (h, w, 6) centre x, y and both sides of the covered parallelogram; written.
    seen : (h, w) bool, the texel is inside the picture and not at a grazing angle; written.
    quality : (h, w) pixels per texel along a side, at most 1, times the sine of the viewing angle; written.
    """
    rows, columns = seen.shape
    corner, right, down, normal = raster
    camera, turn, half = projection.camera, projection.turn, projection.half
    left, top, lens = projection.left, projection.top, projection.lens
    # corners of the row of texels at hand: above and below
    x = np.empty((2, columns + 1))
    y = np.empty((2, columns + 1))
    for r in range(rows + 1):
        for c in range(columns + 1):
            px = corner[0] + c * right[0] + r * down[0]
            py = corner[1] + c * right[1] + r * down[1]
            pz = corner[2] + c * right[2] + r * down[2]
            cx = camera[0, 0] * px + camera[0, 1] * py + camera[0, 2] * pz
            cy = camera[1, 0] * px + camera[1, 1] * py + camera[1, 2] * pz
            cz = camera[2, 0] * px + camera[2, 1] * py + camera[2, 2] * pz
            if len(lens):
                across, along = project_ray(lens, cx, cy, cz)
                x[r % 2, c], y[r % 2, c] = across * projection.width, along * projection.height
                continue
            x[r % 2, c] = (np.arctan2(cx, cz) / (2 * np.pi) + 0.5) * turn - left
            y[r % 2, c] = (0.5 + np.arctan2(cy, np.hypot(cx, cz)) / np.pi) * half - top
        if r == 0:
            continue
        above, below = (r - 1) % 2, r % 2
        for c in range(columns):
            x0 = x[above, c]
            x1 = x0 + _shortest_difference(x[above, c + 1] - x0, turn)
            x2 = x0 + _shortest_difference(x[below, c] - x0, turn)
            x3 = x0 + _shortest_difference(x[below, c + 1] - x0, turn)
            y0, y1, y2, y3 = y[above, c], y[above, c + 1], y[below, c], y[below, c + 1]
            mx, my = (x0 + x1 + x2 + x3) / 4, (y0 + y1 + y2 + y3) / 4
            mx %= turn
            footprints[r - 1, c, 0], footprints[r - 1, c, 1] = mx, my
            footprints[r - 1, c, 2], footprints[r - 1, c, 3] = (x1 - x0 + x3 - x2) / 2, (y1 - y0 + y3 - y2) / 2
            footprints[r - 1, c, 4], footprints[r - 1, c, 5] = (x2 - x0 + x3 - x1) / 2, (y2 - y0 + y3 - y1) / 2
            facing, square = 0.0, 0.0
            for i in range(3):
                ray = corner[i] + (c + 0.5) * right[i] + (r - 0.5) * down[i]
                facing -= ray * normal[i]
                square += ray * ray
            sine = facing / np.sqrt(square)
            area = footprints[r - 1, c, 2] * footprints[r - 1, c, 5] - footprints[r - 1, c, 3] * footprints[r - 1, c, 4]
            quality[r - 1, c] = min(1.0, np.sqrt(abs(area))) * max(sine, 0.0) if area == area else 0.0  # not a number
            inside = mx < projection.width and my >= 0 and my < projection.height
            seen[r - 1, c] = inside and sine >= grazing


@njit(cache=True, nogil=True)
def _shortest_difference(difference: float, turn: float) -> float:
    """Difference of columns, the short way round."""
    shortest: float = difference - turn * np.round(difference / turn)
    return shortest


@njit(cache=True, nogil=True)
def _resample_texels(
    pixels: UInt8Array,
    levels: Int64Array,
    footprints: Float32Array,
    first: float,
    turn: float,
    upper: float,
    mask: Int64Array,
    rgb: UInt8Array,
    seen: BoolArray,
) -> None:
    """Fill the seen texels from a part of the picture, and clear masked ones.

    The part starts at column `first` and row `upper`.
    """
    rows, columns = seen.shape
    for r in range(rows):
        for c in range(columns):
            if not seen[r, c]:
                continue
            x, y, ax, ay, bx, by = footprints[r, c]
            x = (x - first) % turn
            if y + (abs(ay) + abs(by)) / 2 >= mask[min(int(x), len(mask) - 1)]:
                seen[r, c] = False
                continue
            write_parallelogram_mean(pixels, levels, x, y - upper, ax, ay, bx, by, False, rgb[r, c])
