"""From chosen translations to pixels, at the full size: each part is fitted to a pixel, copied and blended."""

from __future__ import annotations

import cv2
import numpy as np
from numba import njit

from facade_core.texture.membrane import membrane

_SAMPLES = 4000  # known pixels that a part's translation is fitted to


def paint(
    image: np.ndarray, known: np.ndarray, chosen: np.ndarray, maps: np.ndarray, factor: int, reach: float
) -> tuple[np.ndarray, np.ndarray]:
    """image (H, W, 3) float32, 0-1, with hidden pixels copied, and which could be (H, W) bool.

    chosen (h, w) int64: the number of the map for every pixel of the image reduced by factor, -1 where known; maps (k, 3) are
    in its pixels. The translation of each connected part is fitted to what is known around it.
    """
    from skimage.measure import label

    parts = label(chosen + 1, background=0, connectivity=1)
    count = int(parts.max())
    first = np.unique(parts, return_index=True)
    at = dict(zip(first[0].tolist(), first[1].tolist(), strict=True))
    fitted = np.zeros((count + 1, 3), np.int64)
    size = 2 * round(reach) + 1
    boxes = _boxes(parts, count)
    for part in range(1, count + 1):
        dy, step, mirrored = maps[chosen.flat[at[part]]]
        full = np.array([dy * factor, step * factor + (factor - 1) * mirrored, mirrored])
        y0, y1, x0, x1 = boxes[part]
        around = np.s_[max(0, y0 - size) : y1 + size, max(0, x0 - size) : x1 + size]
        near = cv2.blur((parts[around] == part).astype(np.float32), (size, size)) > 0
        ys, xs = np.nonzero(near & (chosen[around] < 0))
        where = np.stack([ys + around[0].start, xs + around[1].start], 1)
        where = where[:: max(1, len(where) // _SAMPLES)] * factor + factor // 2
        fitted[part] = _fit(image, known, where, full, factor + 1)
    number = np.repeat(np.repeat(parts, factor, 0), factor, 1)[: known.shape[0], : known.shape[1]].astype(np.int32)
    number[known] = 0
    return _blend(image, known, number, fitted)


def _boxes(parts: np.ndarray, count: int) -> list[tuple[int, int, int, int]]:
    from scipy import ndimage

    return [(0, 0, 0, 0)] + [(a.start, a.stop, b.start, b.stop) for a, b in ndimage.find_objects(parts, count)]


def _fit(image: np.ndarray, known: np.ndarray, where: np.ndarray, about: np.ndarray, room: int) -> np.ndarray:
    """The map within room px of one about which leaves the least difference at the places (n, 2); that one without places."""
    if len(where) < 20:
        return about
    shift = np.arange(-room, room + 1)
    table = np.stack([np.repeat(shift, len(shift)), np.tile(shift, len(shift)), np.zeros(len(shift) ** 2, int)], 1)
    table = table[np.argsort(np.abs(table).sum(1), kind="stable")]
    errors = _differences(image, known, where, about + table)
    return about + table[int(np.argmin(errors))]


@njit(cache=True)
def _differences(image, known, where, maps):
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
                    total += abs(image[y, x, c] - image[v, u, c])
        if seen >= 20:
            out[k] = total / seen
    return out


def _blend(
    image: np.ndarray, known: np.ndarray, number: np.ndarray, fitted: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    copied, wanted_right, wanted_below, filled = _copy(image, known, number, fitted)
    hidden = filled & ~known
    offset = membrane(wanted_right, wanted_below, hidden, number)
    return np.clip(copied + offset, 0.0, 1.0), filled


@njit(cache=True)
def _source(known, fitted, part, y, x):
    """Row of the source and its column, or -1, -1 where it is not known."""
    v = y + fitted[part, 0]
    u = fitted[part, 1] - x if fitted[part, 2] else x + fitted[part, 1]
    if 0 <= v < known.shape[0] and 0 <= u < known.shape[1] and known[v, u]:
        return v, u
    return -1, -1


@njit(cache=True)
def _copy(image, known, number, fitted):
    """The copied image, the steps that make joins invisible (see `membrane`), and what is known or copied."""
    height, width = known.shape
    out = image.copy()
    filled = known.copy()
    for y in range(height):
        for x in range(width):
            if known[y, x]:
                continue
            v, u = _source(known, fitted, number[y, x], y, x)
            filled[y, x] = v >= 0
            for c in range(3):
                out[y, x, c] = image[v, u, c] if v >= 0 else np.float32(0)
    steps = np.full((2, height, width, 3), np.float32(np.nan))
    for y in range(height):
        for x in range(width):
            for side in range(2):
                q, r = y + side, x + 1 - side
                if q >= height or r >= width or not filled[y, x] or not filled[q, r]:
                    continue
                if known[y, x] and known[q, r]:
                    continue
                a, b = number[y, x], number[q, r]
                for c in range(3):
                    steps[side, y, x, c] = 0.0
                if a == b:
                    continue
                # b's picture minus a's at both pixels: what a's offset must exceed b's by
                total, count = np.zeros(3, np.float32), 0
                for i, j in ((y, x), (q, r)):
                    va, ua = (i, j) if a == 0 else _source(known, fitted, a, i, j)
                    vb, ub = (i, j) if b == 0 else _source(known, fitted, b, i, j)
                    # what is hidden has no picture of its own
                    if va < 0 or vb < 0 or (a == 0 and not known[i, j]) or (b == 0 and not known[i, j]):
                        continue
                    count += 1
                    for c in range(3):
                        total[c] += image[va, ua, c] - image[vb, ub, c]
                for c in range(3):
                    steps[side, y, x, c] = total[c] / count if count else np.float32(np.nan)
    return out, steps[0], steps[1], filled
