"""Ground as pictures show it: examples of each surface, laid over all ground of that surface.

The pictured ground around a camera holds rails, paint and manholes, which belong to their place, and plain ground,
which continues. Windows of plain ground are laid on a triangular lattice (Heitz and Neyret 2018; Mikkelsen 2022). At
every point three of them are mixed, by weights to the eighth power, so that one of them mostly decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, Int64Array, UInt8Array
from facade_core.core.hash_uniform import COLUMN_FACTOR, SEED_FACTOR, hash_cell_row, hash_to_random_bits
from facade_core.core.numba_cache import njit
from facade_core.street.materials.settings import GROUND_KERNELS, PICTURED_GROUND

# Height of a lattice row, as a share of the distance between its points.
ROW_HEIGHT = np.sqrt(3) / 2


class GroundPicture(NamedTuple):
    """Piece of ground that cameras show; rows run south, columns east.

    Attributes
    ----------
    rgb : (h, w, 3) uint8.
    is_seen : (h, w) bool, a camera shows the texel.
    surface : (h, w) uint8 index of the surface, by the map.
    texels_per_metre : density.
    """

    rgb: UInt8Array
    is_seen: BoolArray
    surface: UInt8Array
    texels_per_metre: float


class PicturedGround(NamedTuple):
    """Examples of ground surfaces as kernels read them.

    Attributes
    ----------
    texels : (p, 3) uint8 colours of the pictures with windows, row by row, without broad shading.
    first, columns : (pictures,) start of each picture in `texels`, and its width.
    density : (pictures,) texels per metre.
    windows : (w, 3) picture, row and column of the middles of plain windows.
    start : (surfaces + 1,) first window of each surface.
    spacing : (surfaces,) distance between lattice points and radius of the windows, metres.
    colour : (surfaces, 3) mean colour.
    """

    texels: UInt8Array
    first: Int64Array
    columns: Int64Array
    density: Float64Array
    windows: Int64Array
    start: Int64Array
    spacing: Float64Array
    colour: Float64Array


def learn_pictured_ground(pictures: Sequence[GroundPicture], surfaces: int) -> PicturedGround:
    """Learn an example of every surface that pictures show enough plain ground of.

    Parameters
    ----------
    pictures : pieces of ground.
    surfaces : number of surfaces.
    """
    texels = [np.zeros((0, one.rgb.shape[1], 3), np.uint8) for one in pictures]
    windows, spacings, colours = [], np.ones(surfaces), np.zeros((surfaces, 3))
    for surface in range(surfaces):
        shown = [one.is_seen & (one.surface == surface) for one in pictures]
        seen = np.concatenate([np.zeros((0, 3)), *(one.rgb[mask] for one, mask in zip(pictures, shown, strict=True))])
        found = np.zeros((0, 3), np.int64)
        if len(seen):
            typical = colours[surface] = np.maximum(np.median(seen, axis=0), 1)
            plain = [_plain_ground(one, mask, typical) for one, mask in zip(pictures, shown, strict=True)]
            spacings[surface], found = _find_windows(pictures, plain)
            for number in np.unique(found[:, 0]).tolist():
                if not len(texels[number]):
                    texels[number] = np.zeros(pictures[number].rgb.shape, np.uint8)
                detail = _detail(pictures[number], plain[number])[plain[number]]
                texels[number][plain[number]] = np.clip(detail * colours[surface] + 0.5, 0, 255)
        windows.append(found)
    sizes = np.array([one.shape[0] * one.shape[1] for one in texels], np.int64)
    return PicturedGround(
        np.concatenate([np.zeros((0, 3), np.uint8), *(one.reshape(-1, 3) for one in texels)]),
        np.cumsum(sizes) - sizes,
        np.array([one.shape[1] for one in texels], np.int64),
        np.array([one.texels_per_metre for one in pictures], np.float64),
        np.concatenate(windows),
        np.cumsum([0, *map(len, windows)]).astype(np.int64),
        spacings,
        colours,
    )


def _plain_ground(picture: GroundPicture, mask: BoolArray, typical: Float64Array) -> BoolArray:
    """Mask the texels (h, w) of a surface that look as it does elsewhere, broadly and in detail."""
    import cv2

    side = max(1, round(PICTURED_GROUND.square_m * picture.texels_per_metre))
    broad = np.maximum(_local_mean(picture.rgb, mask, side), 1)
    detail = np.abs(picture.rgb / broad - 1).max(axis=2)
    plain = mask & (np.abs(broad / typical - 1).max(axis=2) <= PICTURED_GROUND.max_deviation)
    if not plain.any():
        return mask & False
    thin = mask & (detail > PICTURED_GROUND.max_detail_deviations * np.median(detail[plain]))
    # single dark grains are texture, lines of them are not
    thin = cv2.morphologyEx(thin.astype(np.uint8), cv2.MORPH_OPEN, np.ones((2, 2), np.uint8)) > 0
    spoilt = (~plain | thin).astype(np.uint8)
    near = cv2.dilate(spoilt, np.ones((side // 2 * 2 + 1,) * 2, np.uint8), borderValue=0)
    return np.asarray(near == 0)


def _local_mean(rgb: UInt8Array, mask: BoolArray, side: int) -> Float32Array:
    """Compute means of the masked texels over squares of `side` texels."""
    import cv2

    count = cv2.blur(mask.astype(np.float32), (side, side))
    total = cv2.blur(np.where(mask[..., None], rgb, 0).astype(np.float32), (side, side))
    mean: Float32Array = (total / np.maximum(count, np.float32(1e-6))[..., None]).astype(np.float32)
    return mean


def _detail(picture: GroundPicture, plain: BoolArray) -> Float32Array:
    """Compute colours (h, w, 3) relative to the mean of the plain ground around."""
    side = 2 * round(PICTURED_GROUND.shading_m * picture.texels_per_metre) + 1
    detail: Float32Array = (picture.rgb / np.maximum(_local_mean(picture.rgb, plain, side), 1)).astype(np.float32)
    return detail


def _find_windows(pictures: Sequence[GroundPicture], plain: Sequence[BoolArray]) -> tuple[float, Int64Array]:
    """Find the largest spacing for which there are enough windows, and the windows (k, 3); none if there are too few."""
    import cv2

    for spacing in PICTURED_GROUND.spacings_m:
        found, area = [], 0.0
        for number, (one, mask) in enumerate(zip(pictures, plain, strict=True)):
            # a lattice point reaches as far as the next ones, and rounding a texel farther
            reach = int(np.ceil(spacing * one.texels_per_metre)) + 1
            padded = np.pad(mask, 1).astype(np.uint8)
            inside = cv2.distanceTransform(padded, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1] > reach
            rows, columns = np.nonzero(inside)
            found.append(np.column_stack([np.full(len(rows), number), rows, columns]))
            area += len(rows) / one.texels_per_metre**2
        windows = np.concatenate(found).astype(np.int64)
        if area >= PICTURED_GROUND.min_area_m2:
            kept = np.linspace(0, len(windows) - 1, min(len(windows), PICTURED_GROUND.max_windows)).astype(np.int64)
            return spacing, windows[kept]
    return 1.0, np.zeros((0, 3), np.int64)


@njit(cache=True, error_model="numpy")
def add_pictured_ground(
    surface: int,
    x: Float64Array,
    y: Float64Array,
    side: Float64Array,
    ground: PicturedGround,
    seed: int,
    share: Float64Array,
    total: Float64Array,
) -> None:
    """Add the colours of points on a pictured surface.

    Parameters
    ----------
    surface : index of the surface, which has windows.
    x, y : (n,) world coordinates east and north, metres.
    side : (n,) footprints, metres. A footprint far larger than a texel of the pictures has the mean colour.
    ground : examples of the surfaces.
    seed : random seed.
    share : (n,) factors.
    total : (n, 3) sums.
    """
    first, count = ground.start[surface], ground.start[surface + 1] - ground.start[surface]
    spacing, colour = ground.spacing[surface], ground.colour[surface]
    surface_seed = np.uint64(seed + 127 + surface) * SEED_FACTOR
    sample, weight = np.empty((3, 3)), np.empty(3)
    for k in range(len(x)):
        if share[k] <= 1e-3:
            continue
        v = y[k] / (spacing * ROW_HEIGHT)
        u = x[k] / spacing - 0.5 * v
        column, row = np.floor(u), np.floor(v)
        right, up = u - column, v - row
        upper = right + up > 1
        squares = 0.0
        for corner in range(3):
            # the lower triangle has the corners (0, 0), (1, 0), (0, 1), the upper one (1, 1), (1, 0), (0, 1)
            if corner == 0:
                at_u, at_v = (column + 1, row + 1) if upper else (column, row)
                near = right + up - 1 if upper else 1 - right - up
            elif corner == 1:
                at_u, at_v, near = column + 1, row, 1 - up if upper else right
            else:
                at_u, at_v, near = column, row + 1, 1 - right if upper else up
            h = np.uint64(np.int64(at_u)) * COLUMN_FACTOR + hash_cell_row(at_v, surface_seed)
            window = ground.windows[first + np.int64(hash_to_random_bits(h)) % count]
            density = ground.density[window[0]]
            east, north = x[k] - (at_u + 0.5 * at_v) * spacing, y[k] - at_v * spacing * ROW_HEIGHT
            i = window[1] - np.int64(np.floor(north * density + 0.5))
            j = window[2] + np.int64(np.floor(east * density + 0.5))
            texel = ground.texels[ground.first[window[0]] + i * ground.columns[window[0]] + j]
            light = 0.0
            for band in range(3):
                sample[corner, band] = texel[band]
                light += texel[band] / colour[band] / 3
            # bright grain has more weight: a window then ends along its grain, not along a straight line
            near = max(near + GROUND_KERNELS.window_grain_weight * (light - 1), 1e-4)
            near *= near
            near *= near
            weight[corner] = near * near
            squares += weight[corner]
        spread = 0.0
        for corner in range(3):
            weight[corner] /= squares
            spread += weight[corner] * weight[corner]
        step = 1 / ground.density[ground.windows[first, 0]]
        kept = min(max((4 * step - side[k]) / (2 * step), 0.0), 1.0) / np.sqrt(spread)
        for band in range(3):
            mixed = 0.0
            for corner in range(3):
                mixed += weight[corner] * sample[corner, band]
            total[k, band] += share[k] * (colour[band] + kept * (mixed - colour[band]))
