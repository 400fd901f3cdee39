"""A chart's raster from a posed panorama."""

from __future__ import annotations

import numpy as np
from numba import njit

from facade_core.errors import ImageError
from facade_core.rectify.camera import camera_from_world, position
from facade_core.rectify.pyramid import area_mean, pyramid
from facade_core.rectify.sightings import GRAZING_DEG, visible
from facade_core.street.scene import Scene
from facade_core.types import Pose

# Rays cast at once, which bounds memory.
RAYS = 1 << 18
# Colour distance to the bottom row within which pixels above it belong to the same flat mask.
FLAT = 12
# Rows above the mask that compression has mixed with it.
MASK_RIM = 4
# Share of the full panorama's height above which a flat bottom is ground, not a mask.
MASK_HIGHEST = 2 / 3


def rectify_panorama(
    scene: Scene, chart: int, image: np.ndarray, pose: Pose, size: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """A chart as a panorama shows it: rgb (h, w, 3) uint8, and seen (h, w) bool; black where not seen.

    image (H, W, 3) uint8 is the part pose.view of the full panorama; size (h, w) divides the chart's place in the atlas, whose
    own size gives the atlas's texels. A texel is the mean of the pixels it covers. Not seen are texels behind other surfaces,
    at a grazing angle, outside the picture or in the flat mask at its bottom. Raises GeometryError for a pose without height,
    ImageError for an image that is not uint8 RGB.
    """
    if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8 or 0 in image.shape:
        raise ImageError(f"a panorama is uint8 RGB (h, w, 3), not {image.dtype} {image.shape}; convert it")
    charts, placement = scene.charts, scene.placement
    rows, columns = size
    place = position(pose)
    right = charts.axis_u[chart] * (placement.width[chart] / scene.spec.texels_per_metre / columns)
    down = charts.axis_v[chart] * (placement.height[chart] / scene.spec.texels_per_metre / rows)
    corner = charts.origin[chart] - place
    left, top, width, height = pose.view
    turn = image.shape[1] / width  # pixels all around
    footprints = np.empty((rows, columns, 6), np.float32)
    seen = np.empty((rows, columns), np.bool_)
    _footprints(
        corner,
        right,
        down,
        camera_from_world(pose),
        charts.normal()[chart],
        np.sin(np.radians(GRAZING_DEG)),
        (turn, image.shape[0] / height, left * turn, top * image.shape[0] / height),
        image.shape[:2],
        footprints,
        seen,
    )
    _hide(scene, chart, place, corner, right, down, seen)
    rgb = np.zeros((rows, columns, 3), np.uint8)
    if not seen.any():
        return rgb, seen
    first, columns_used = _columns(footprints[seen], image.shape[1], turn)
    y, reach = footprints[seen, 1], _margin(footprints[seen])
    upper = max(0, int(y.min() - reach))
    lower = min(image.shape[0], int(y.max() + reach) + 1)
    mask = _mask_top(image, columns_used, round((MASK_HIGHEST - top) / height * image.shape[0]), lower)
    part = pyramid(image[upper:lower][:, columns_used])
    _resample(part.pixels, part.levels, footprints, float(first), turn, float(upper), mask, rgb, seen)
    return rgb, seen


def _hide(scene: Scene, chart: int, place, corner, right, down, seen: np.ndarray) -> None:
    """Clear the seen texels that something stands before."""
    rows, columns = seen.shape
    along = (np.arange(columns) + 0.5)[:, None] * right
    band = max(1, RAYS // columns)
    for start in range(0, rows, band):
        part = seen[start : start + band]
        if not part.any():
            continue
        rays = corner + (np.arange(start, start + len(part)) + 0.5)[:, None, None] * down + along
        part[part] = visible(scene, chart, place, rays[part])


def _margin(footprints: np.ndarray) -> float:
    """Pixels around texel centres that resampling reads."""
    return float(np.abs(footprints[:, 2:]).max()) + 3.0


def _columns(footprints: np.ndarray, width: int, turn: float) -> tuple[int, np.ndarray]:
    """The first column and all columns of the picture that texels need; a full panorama goes on across its border."""
    x, margin = footprints[:, 0], _margin(footprints)
    if turn > width:
        first = max(0, int(x.min() - margin))
        return first, np.arange(first, min(width, int(x.max() + margin) + 1))
    angle = x * (2 * np.pi / turn)
    middle = np.arctan2(np.sin(angle).mean(), np.cos(angle).mean()) * turn / (2 * np.pi)
    offset = (x - middle + turn / 2) % turn - turn / 2
    first = int(np.floor(middle + max(offset.min() - margin, -turn / 2)))
    last = int(np.ceil(middle + min(offset.max() + margin, turn / 2)))
    return first, np.arange(first, last + 1) % width


def _mask_top(image: np.ndarray, columns: np.ndarray, highest: int, lower: int) -> np.ndarray:
    """First row of the flat mask at the bottom of each column: black, or whatever one colour the whole bottom row has.

    Rows above `highest` are never masked; rows from `lower` on are of no interest.
    """
    none = np.full(len(columns), len(image))
    highest = max(highest, 0)
    if lower <= highest:
        return none
    bottom = image[-1].astype(np.int16)
    colour = np.median(bottom, axis=0)
    if (np.abs(bottom - colour).max(axis=1) > FLAT).mean() > 0.05:
        return none
    low, high = np.clip(colour - FLAT, 0, 255).astype(np.uint8), np.clip(colour + FLAT, 0, 255).astype(np.uint8)
    part = image[highest:][::-1][:, columns]
    flat = ((part >= low) & (part <= high)).all(axis=2)
    run = np.where(flat.all(axis=0), len(flat), flat.argmin(axis=0))
    return np.where(run > 0, np.maximum(len(image) - run - MASK_RIM, highest), none)


@njit(cache=True, nogil=True)
def _footprints(corner, right, down, camera, normal, grazing, scale, shape, footprints, seen):
    """Per texel its centre in the picture and the two sides of the parallelogram it covers there; whether it may be seen.

    scale: pixels per turn and per half turn, and the full panorama's pixels left of and above the picture.
    """
    rows, columns = seen.shape
    turn, half, left, top = scale
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
            x[r % 2, c] = (np.arctan2(cx, cz) / (2 * np.pi) + 0.5) * turn - left
            y[r % 2, c] = (0.5 + np.arctan2(cy, np.hypot(cx, cz)) / np.pi) * half - top
        if r == 0:
            continue
        above, below = (r - 1) % 2, r % 2
        for c in range(columns):
            x0 = x[above, c]
            x1 = x0 + _across(x[above, c + 1] - x0, turn)
            x2 = x0 + _across(x[below, c] - x0, turn)
            x3 = x0 + _across(x[below, c + 1] - x0, turn)
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
            inside = mx < shape[1] and my >= 0 and my < shape[0]
            seen[r - 1, c] = inside and facing >= grazing * np.sqrt(square)


@njit(cache=True, nogil=True)
def _across(difference, turn):
    """A difference of columns the short way round."""
    return difference - turn * np.round(difference / turn)


@njit(cache=True, nogil=True)
def _resample(pixels, levels, footprints, first, turn, upper, mask, rgb, seen):
    """Fill the seen texels from a part of the picture that starts at column `first` and row `upper`; unsee the masked."""
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
            area_mean(pixels, levels, x, y - upper, ax, ay, bx, by, False, rgb[r, c])
