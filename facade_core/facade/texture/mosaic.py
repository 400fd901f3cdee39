"""Render chosen translations at full size: each part is fitted to a pixel, copied and blended."""

from __future__ import annotations

import cv2
import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Int32Array, Int64Array, UInt8Array
from facade_core.core.numba_cache import njit
from facade_core.facade.texture.gradient_blending import solve_colour_offsets
from facade_core.facade.texture.settings import BLENDING


def fill_from_chosen_sources(
    image: UInt8Array, known: BoolArray, chosen: Int64Array, translations: Int64Array, factor: int, reach: float
) -> tuple[UInt8Array, BoolArray]:
    """Copy and blend hidden pixels from their chosen sources.

    The translation of each connected part is fitted to the known pixels around it.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    known : (H, W) bool.
    chosen : (h, w) int64 index of the translation for every pixel of the image reduced by `factor`, -1 where known.
    translations : (k, 3) dy, step, mirrored in reduced pixels.
    factor : reduction.
    reach : distance, in reduced pixels, of known pixels that a part is fitted to.

    Returns
    -------
    (H, W, 3) uint8, and (H, W) bool pixels that are known now.
    """
    from skimage.measure import label

    parts = label(chosen + 1, background=0, connectivity=1)
    count = int(parts.max())
    first = np.unique(parts, return_index=True)
    at = dict(zip(first[0].tolist(), first[1].tolist(), strict=True))
    fitted = np.zeros((count + 1, 3), np.int64)
    size = 2 * round(reach) + 1
    boxes = _part_bounds(parts, count)
    for part in range(1, count + 1):
        dy, step, mirrored = translations[chosen.flat[at[part]]]
        full = np.array([dy * factor, step * factor + (factor - 1) * mirrored, mirrored])
        y0, y1, x0, x1 = boxes[part]
        around = np.s_[max(0, y0 - size) : y1 + size, max(0, x0 - size) : x1 + size]
        near = cv2.blur((parts[around] == part).astype(np.float32), (size, size)) > 0
        ys, xs = np.nonzero(near & (chosen[around] < 0))
        where = np.stack([ys + around[0].start, xs + around[1].start], 1)
        where = where[:: max(1, len(where) // BLENDING.max_samples)] * factor + factor // 2
        fitted[part] = _fit_translation(image, known, where, full, factor + 1)
    number = np.repeat(np.repeat(parts, factor, 0), factor, 1)[: known.shape[0], : known.shape[1]].astype(np.int32)
    number[known] = 0
    return _blend_holes(image, known, number, fitted)


def _part_bounds(parts: Int64Array, count: int) -> list[tuple[int, int, int, int]]:
    from scipy import ndimage

    return [(0, 0, 0, 0)] + [(a.start, a.stop, b.start, b.stop) for a, b in ndimage.find_objects(parts, count)]


def _fit_translation(
    image: UInt8Array, known: BoolArray, where: Int64Array, about: Int64Array, radius: int
) -> Int64Array:
    """Return the translation within `radius` px of `about` with the least difference at the places (n, 2)."""
    if len(where) < 20:
        return about
    shift = np.arange(-radius, radius + 1)
    table = np.stack([np.repeat(shift, len(shift)), np.tile(shift, len(shift)), np.zeros(len(shift) ** 2, int)], 1)
    table = table[np.argsort(np.abs(table).sum(1), kind="stable")]
    errors = _mean_differences(image, known, where, about + table)
    translation: Int64Array = about + table[int(np.argmin(errors))]
    return translation


@njit(cache=True)
def _mean_differences(image: UInt8Array, known: BoolArray, where: Int64Array, maps: Int64Array) -> Float32Array:
    height, width = known.shape
    out = np.full(len(maps), np.float32(3e38))
    for k in range(len(maps)):
        dy, step, mirrored = maps[k]
        total, seen = np.float32(0), 0
        for n in range(len(where)):
            y, x = where[n]
            if y >= height or x >= width:
                continue
            v, u = y + dy, step - x if mirrored else x + step
            if 0 <= v < height and 0 <= u < width and known[y, x] and known[v, u]:
                seen += 1
                for c in range(3):
                    total += abs(np.float32(image[y, x, c]) - np.float32(image[v, u, c]))
        if seen >= 20:
            out[k] = total / seen
    return out


def _blend_holes(
    image: UInt8Array, known: BoolArray, number: Int32Array, fitted: Int64Array
) -> tuple[UInt8Array, BoolArray]:
    """Copy and blend hole by hole, so that memory is bounded by the largest hole."""
    from scipy import ndimage

    out, done = image.copy(), known.copy()
    joined = cv2.dilate(
        (~known).astype(np.uint8), np.ones((2 * BLENDING.join_radius_px + 1, 2 * BLENDING.join_radius_px + 1), np.uint8)
    )
    numbered, _ = ndimage.label(joined)
    for k, (rows, columns) in enumerate(ndimage.find_objects(numbered), 1):
        copied, steps, filled = _copy_box(
            image, known, number, fitted, rows.start, rows.stop, columns.start, columns.stop
        )
        hidden = filled & ~known[rows, columns] & (numbered[rows, columns] == k)
        if not hidden.any():
            continue
        offset = solve_colour_offsets(steps[0], steps[1], hidden, number[rows, columns])
        blended = np.clip(np.rint((copied + offset) * 255.0), 0, 255).astype(np.uint8)
        out[rows, columns][hidden] = blended[hidden]
        done[rows, columns] |= hidden
    return out, done


@njit(cache=True)
def _source_pixel(known: BoolArray, fitted: Int64Array, part: int, y: int, x: int) -> tuple[int, int]:
    """Return row and column of the source, -1, -1 if it is not known."""
    v = y + fitted[part, 0]
    u = fitted[part, 1] - x if fitted[part, 2] else x + fitted[part, 1]
    if 0 <= v < known.shape[0] and 0 <= u < known.shape[1] and known[v, u]:
        return v, u
    return -1, -1


@njit(cache=True)
def _copy_box(
    image: UInt8Array,
    known: BoolArray,
    number: Int32Array,
    fitted: Int64Array,
    top: int,
    bottom: int,
    left: int,
    right: int,
) -> tuple[Float32Array, Float32Array, BoolArray]:
    """Return a box's copied image, 0-1, the steps that make joins invisible (`solve_colour_offsets`), and its filled pixels."""
    unit = np.float32(1.0 / 255.0)
    tall, wide = bottom - top, right - left
    out = np.zeros((tall, wide, 3), np.float32)
    filled = np.zeros((tall, wide), np.bool_)
    for y in range(top, bottom):
        for x in range(left, right):
            v, u = (y, x) if known[y, x] else _source_pixel(known, fitted, number[y, x], y, x)
            filled[y - top, x - left] = v >= 0
            if v >= 0:
                for c in range(3):
                    out[y - top, x - left, c] = image[v, u, c] * unit
    steps = np.full((2, tall, wide, 3), np.float32(np.nan))
    for y in range(top, bottom):
        for x in range(left, right):
            for side in range(2):
                q, r = y + side, x + 1 - side
                if q >= bottom or r >= right or not filled[y - top, x - left] or not filled[q - top, r - left]:
                    continue
                if known[y, x] and known[q, r]:
                    continue
                a, b = number[y, x], number[q, r]
                if a == b:
                    for c in range(3):
                        steps[side, y - top, x - left, c] = 0.0
                    continue
                # Mean difference of a's and b's pictures at both pixels: b's offset must exceed a's by it.
                total, count = np.zeros(3, np.float32), 0
                for i, j in ((y, x), (q, r)):
                    va, ua = _pictured_pixel(known, fitted, a, i, j)
                    vb, ub = _pictured_pixel(known, fitted, b, i, j)
                    if va < 0 or vb < 0:
                        continue
                    count += 1
                    for c in range(3):
                        total[c] += np.float32(image[va, ua, c]) * unit - np.float32(image[vb, ub, c]) * unit
                for c in range(3):
                    steps[side, y - top, x - left, c] = total[c] / count if count else np.float32(np.nan)
    return out, steps, filled


@njit(cache=True)
def _pictured_pixel(known: BoolArray, fitted: Int64Array, part: int, y: int, x: int) -> tuple[int, int]:
    """Return the pixel that a part shows at a position, part 0 being the known image; -1, -1 if none."""
    if part > 0:
        pixel: tuple[int, int] = _source_pixel(known, fitted, part, y, x)
        return pixel
    return (y, x) if known[y, x] else (-1, -1)
