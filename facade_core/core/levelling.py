"""Seams between what is known better and worse: a smooth offset brings the worse to the better's colour at their border."""

from __future__ import annotations

import numpy as np

# Metres from a seam at which a third of its offset is left.
LEVELLED_M = 2.0
# So many times as far away, what is left of it is not seen: nothing there needs a look.
LEVELLED_REACHES = 2.5
# Texels around a seam whose mean colours are compared: more than a texture's grain, less than a window.
BESIDE = 9
# Levels out of 255 by which a seam is levelled at most: beyond, two materials meet, not two exposures of one.
LARGEST = 64.0
# Of the membrane, at each size.
RELAXATIONS = 24


def fill_unknown(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """values (h, w, c) with those that are not `known` (h, w) bool taken from the known ones around: (h, w, c) float32.

    Means of ever larger squares: a texel takes that of the smallest square of a power of two that holds a known one, so that
    whoever averages squares in turn, as mipmaps do, meets nothing but known colours. Zeros where nothing is known.
    """
    weight = known.astype(np.float32)
    return _means(values.astype(np.float32) * weight[..., None], weight)


def filled(colour: np.ndarray, known: np.ndarray) -> np.ndarray:
    """colour (h, w, c) uint8 with those that are not `known` (h, w) bool as `spread` has them, rounded.

    The finest size, of four times as many texels as all others together, is gone through without floats.
    """
    height, width = known.shape
    total, weight = (
        _halved(array, dtype).astype(np.float32)
        for array, dtype in ((colour * known[..., None], np.uint16), (known, np.uint8))
    )
    near = np.round(_means(total, weight)).astype(np.uint8)
    return np.where(known[..., None], colour, near.repeat(2, axis=0).repeat(2, axis=1)[:height, :width])


def _means(total: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Of sums (h, w, c) of so many known values (h, w), both float32."""
    levels = [(total, weight)]
    while max(levels[-1][1].shape) > 1:
        levels.append(tuple(_halved(array) for array in levels[-1]))  # type: ignore[arg-type]
    result = np.zeros((1, 1, total.shape[2]), np.float32)
    for total, weight in reversed(levels):
        coarse = (
            result.repeat(2, axis=0).repeat(2, axis=1)[: weight.shape[0], : weight.shape[1]]
            if weight.size > 1
            else result
        )
        result = np.where((weight > 0)[..., None], total / np.maximum(weight, 1e-9)[..., None], coarse)
    return result


def level_seam(colour: np.ndarray, fixed: np.ndarray, free: np.ndarray, *, reach: float) -> np.ndarray:
    """A chart's colour (h, w, 3) uint8 with the texels `free` levelled to those `fixed`, both (h, w) bool and disjoint.

    Along their border the mean colours on both sides are compared, LARGEST at most; a membrane through that difference is
    added to the free texels, less with the distance from the border: a third of it is left after `reach` texels. So a seam
    goes, and a patch of another colour does not tint a whole wall. Fixed texels keep their colour.
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
        total = cv2.blur(colour.astype(np.float32) * mask[..., None], (BESIDE, BESIDE), borderType=cv2.BORDER_CONSTANT)
        share = cv2.blur(mask, (BESIDE, BESIDE), borderType=cv2.BORDER_CONSTANT)
        means.append(total / np.maximum(share, 1e-6)[..., None])
    offset = _membrane(np.clip(means[0] - means[1], -LARGEST, LARGEST), border)
    away = cv2.distanceTransform((~grown).astype(np.uint8), cv2.DIST_L2, 3)
    offset *= np.exp(-away / reach)[..., None]
    levelled = colour.copy()
    levelled[free] = np.round(np.clip(colour[free] + offset[free], 0, 255)).astype(np.uint8)
    return levelled


def _membrane(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """The smooth sheet (h, w, c) float32 through the known values: each other is its neighbours' mean, the edges are free.

    Coarse to fine, so that few relaxations at each size do.
    """
    import cv2

    weight = known.astype(np.float32)
    levels = [(values.astype(np.float32) * weight[..., None], weight)]
    while max(levels[-1][1].shape) > 2:
        levels.append(tuple(_halved(array) for array in levels[-1]))  # type: ignore[arg-type]
    total, weight = levels[-1]
    sheet = np.broadcast_to(total.sum(axis=(0, 1)) / weight.sum(), total.shape)
    cross = np.array([[0, 1, 0], [1, 0, 1], [0, 1, 0]], np.float32) / 4
    for total, weight in reversed(levels):
        height, width = weight.shape
        if sheet.shape[:2] != (height, width):
            sheet = cv2.resize(sheet, (2 * sheet.shape[1], 2 * sheet.shape[0]), interpolation=cv2.INTER_LINEAR)
            sheet = np.ascontiguousarray(sheet[:height, :width])
        held = (weight > 0)[..., None]
        pinned = total / np.maximum(weight, 1e-9)[..., None]
        for _ in range(RELAXATIONS):
            sheet = np.where(held, pinned, cv2.filter2D(sheet, -1, cross, borderType=cv2.BORDER_REPLICATE))
    return sheet


def _halved(array: np.ndarray, dtype: type | None = None) -> np.ndarray:
    """Sums of squares of 2 x 2, as their own type or one that holds more; an odd last row or column stands alone."""
    rows, columns = array.shape[0] % 2, array.shape[1] % 2
    padded = np.pad(array, [(0, rows), (0, columns)] + [(0, 0)] * (array.ndim - 2)) if rows or columns else array
    total = np.add(padded[::2, ::2], padded[1::2, ::2], dtype=dtype)
    total += padded[::2, 1::2]
    total += padded[1::2, 1::2]
    return total
