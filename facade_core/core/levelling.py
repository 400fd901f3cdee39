"""Removal of colour seams by a smooth offset, and filling of unknown texels from known ones."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import AnyArray, BoolArray, Float32Array, FloatArray, NumericArray, UInt8Array
from facade_core.core.numba_cache import njit

# Metres from a seam at which its offset has fallen to 1 / e.
SEAM_DECAY_M = 2.0
# Beyond this many decay lengths the rest of the offset is invisible, and texels need not be read.
MAX_SEAM_DECAYS = 2.5
# Side in texels of the window whose mean colours are compared: more than a texture's grain, less than a window.
MEAN_WINDOW_TEXELS = 9
# Levels out of 255. A larger difference separates two materials, not two exposures of one.
MAX_SEAM_OFFSET = 64.0
# Jacobi iterations of the membrane at each size.
RELAXATIONS_PER_SIZE = 24


def fill_unknown_values(values: NumericArray, known: BoolArray) -> Float32Array:
    """Fill unknown values with the means of known ones around them (pull-push).

    An unknown value takes the mean of the smallest square with a power-of-two side that contains a known one. So means
    over such squares, as in mipmaps, are means of known values only.

    Parameters
    ----------
    values : (height, width, channels).
    known : (height, width).

    Returns
    -------
    (height, width, channels); zeros where nothing is known.
    """
    weight = known.astype(np.float32)
    return _known_means(values.astype(np.float32) * weight[..., None], weight)


def fill_unknown_colours(colour: UInt8Array, known: BoolArray) -> UInt8Array:
    """Fill unknown colours as `fill_unknown_values` does, rounded to bytes.

    The finest size, with four times as many texels as all others together, is processed in one pass without floats.

    Parameters
    ----------
    colour : (height, width, channels).
    known : (height, width).

    Returns
    -------
    (height, width, channels).
    """
    near = np.round(_known_means(*_sum_known_blocks(colour, known))).astype(np.uint8)
    return _fill_from_blocks(colour, known, near)


@njit(cache=True)
def _sum_known_blocks(colour: UInt8Array, known: BoolArray) -> tuple[Float32Array, Float32Array]:
    """Sum the known colours of blocks of 2 x 2, and count them."""
    height, width, channels = colour.shape
    total = np.zeros(((height + 1) // 2, (width + 1) // 2, channels), np.float32)
    weight = np.zeros(total.shape[:2], np.float32)
    for y in range(height):
        for x in range(width):
            if known[y, x]:
                weight[y // 2, x // 2] += np.float32(1)
                for c in range(channels):
                    total[y // 2, x // 2, c] += np.float32(colour[y, x, c])
    return total, weight


@njit(cache=True)
def _fill_from_blocks(colour: UInt8Array, known: BoolArray, near: UInt8Array) -> UInt8Array:
    """Take unknown colours from those of blocks of 2 x 2."""
    height, width, channels = colour.shape
    filled = np.empty(colour.shape, np.uint8)
    for y in range(height):
        for x in range(width):
            for c in range(channels):
                filled[y, x, c] = colour[y, x, c] if known[y, x] else near[y // 2, x // 2, c]
    return filled


def _known_means(total: Float32Array, weight: Float32Array) -> Float32Array:
    """Compute the pyramid means of sums (h, w, c) of `weight` (h, w) known values."""
    levels = [(total, weight)]
    while max(levels[-1][1].shape) > 1:
        levels.append(tuple(_sum_blocks(array) for array in levels[-1]))  # type: ignore[arg-type]
    result = np.zeros((1, 1, total.shape[2]), np.float32)
    for total, weight in reversed(levels):
        coarse = (
            result.repeat(2, axis=0).repeat(2, axis=1)[: weight.shape[0], : weight.shape[1]]
            if weight.size > 1
            else result
        )
        result = np.where((weight > 0)[..., None], total / np.maximum(weight, 1e-9)[..., None], coarse)
    return result


def level_seam_colours(colour: UInt8Array, fixed: BoolArray, free: BoolArray, *, reach: float) -> UInt8Array:
    """Level the seam between the fixed and the free texels of a chart.

    The mean colours on both sides of the border are compared, up to MAX_SEAM_OFFSET. A membrane through the difference
    is added to the free texels, and decays with the distance from the border, so that a patch does not tint a whole
    wall.

    Parameters
    ----------
    colour : (height, width, 3) RGB of the chart.
    fixed, free : (height, width), disjoint; only free texels change.
    reach : texels from the border at which the offset has fallen to 1 / e.

    Returns
    -------
    (height, width, 3) RGB.
    """
    import cv2

    if not fixed.any() or not free.any():
        return colour
    grown = cv2.dilate(fixed.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    border = free & grown
    if not border.any():
        return colour
    means = []
    for region in (fixed, free):
        mask = region.astype(np.float32)
        total = cv2.blur(
            colour.astype(np.float32) * mask[..., None],
            (MEAN_WINDOW_TEXELS, MEAN_WINDOW_TEXELS),
            borderType=cv2.BORDER_CONSTANT,
        )
        share = cv2.blur(mask, (MEAN_WINDOW_TEXELS, MEAN_WINDOW_TEXELS), borderType=cv2.BORDER_CONSTANT)
        means.append(total / np.maximum(share, 1e-6)[..., None])
    offset = _membrane(np.clip(means[0] - means[1], -MAX_SEAM_OFFSET, MAX_SEAM_OFFSET), border)
    away = cv2.distanceTransform((~grown).astype(np.uint8), cv2.DIST_L2, 3)
    offset *= np.exp(-away / reach)[..., None]
    levelled = colour.copy()
    levelled[free] = np.round(np.clip(colour[free] + offset[free], 0, 255)).astype(np.uint8)
    return levelled


def _membrane(values: FloatArray, known: BoolArray) -> Float32Array:
    """Interpolate known values (h, w, c) smoothly, with free borders, by relaxation from coarse to fine."""
    import cv2

    weight = known.astype(np.float32)
    levels = [(values.astype(np.float32) * weight[..., None], weight)]
    while max(levels[-1][1].shape) > 2:
        levels.append(tuple(_sum_blocks(array) for array in levels[-1]))  # type: ignore[arg-type]
    total, weight = levels[-1]
    sheet = np.broadcast_to(total.sum(axis=(0, 1)) / weight.sum(), total.shape)
    cross = np.array([[0, 1, 0], [1, 0, 1], [0, 1, 0]], np.float32) / 4
    for total, weight in reversed(levels):
        height, width = weight.shape
        if sheet.shape[:2] != (height, width):
            sheet = cv2.resize(sheet, (2 * sheet.shape[1], 2 * sheet.shape[0]), interpolation=cv2.INTER_LINEAR)
            sheet = np.ascontiguousarray(sheet[:height, :width])
        held = np.nonzero(weight > 0)  # a border, of few texels
        pinned = total[held] / weight[held][:, None]
        for _ in range(RELAXATIONS_PER_SIZE):
            sheet = cv2.filter2D(sheet, -1, cross, borderType=cv2.BORDER_REPLICATE)
            sheet[held] = pinned
    return sheet


def _sum_blocks(array: AnyArray) -> NumericArray:
    """Sum blocks of 2 x 2, zero-padded for odd sizes."""
    rows, columns = array.shape[0] % 2, array.shape[1] % 2
    padded = np.pad(array, [(0, rows), (0, columns)] + [(0, 0)] * (array.ndim - 2)) if rows or columns else array
    total: NumericArray = padded[::2, ::2] + padded[1::2, ::2]
    total += padded[::2, 1::2]
    total += padded[1::2, 1::2]
    return total
