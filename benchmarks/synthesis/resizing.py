"""What a facade is resized by without knowing that it is one: image quilting and seam carving, to compare with."""

from __future__ import annotations

import cv2
import numpy as np
from numba import njit

from facade_core.facade.texture.seams import find_min_error_path

_BLOCK, _OVERLAP = 60, 15
_TOLERANCE = 1.1  # blocks within this factor of the least error are drawn from


def quilt(image: np.ndarray, size: tuple[int, int], rng: np.random.Generator) -> np.ndarray:
    """Image quilting (Efros and Freeman 2001): image (H, W, 3) uint8 as a texture of size (H', W')."""
    step = _BLOCK - _OVERLAP
    tall, wide = (-(-(side - _OVERLAP) // step) for side in size)
    out = np.zeros((tall * step + _OVERLAP, wide * step + _OVERLAP, 3), np.float32)
    source = image.astype(np.float32)
    for m in range(tall):
        for n in range(wide):
            here = np.s_[m * step : m * step + _BLOCK, n * step : n * step + _BLOCK]
            old, overlap = out[here], np.zeros((_BLOCK, _BLOCK), np.float32)
            overlap[:_OVERLAP] += m > 0
            overlap[:, :_OVERLAP] += n > 0
            overlap = np.minimum(overlap, 1.0)
            if overlap.any():
                mask = np.repeat(overlap[..., None], 3, 2)
                error = cv2.matchTemplate(source, old, cv2.TM_SQDIFF, mask=mask)
                near = np.argwhere(error <= _TOLERANCE * max(float(error.min()), 1.0))
                y, x = near[rng.integers(len(near))]
            else:
                y, x = (int(rng.integers(side - _BLOCK + 1)) for side in image.shape[:2])
            new = source[y : y + _BLOCK, x : x + _BLOCK]
            squared = ((new - old) ** 2).sum(2).astype(np.float64)
            shown = np.ones((_BLOCK, _BLOCK), bool)
            if m > 0:
                shown &= (
                    np.arange(_BLOCK)[:, None] >= find_min_error_path(np.ascontiguousarray(squared[:_OVERLAP].T))[None]
                )
            if n > 0:
                shown &= (
                    np.arange(_BLOCK)[None] >= find_min_error_path(np.ascontiguousarray(squared[:, :_OVERLAP]))[:, None]
                )
            out[here] = np.where(shown[..., None], new, old)
    return out[: size[0], : size[1]].astype(np.uint8)


def carve(image: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Seam carving (Avidan and Shamir 2007): seams of least gradient removed or doubled, columns first, then rows."""
    wider = _columns(image, size[1])
    return np.ascontiguousarray(_columns(np.ascontiguousarray(wider.transpose(1, 0, 2)), size[0]).transpose(1, 0, 2))


def _columns(image: np.ndarray, width: int) -> np.ndarray:
    while image.shape[1] != width:
        # no more than half of the columns are doubled at once, so that no seam is taken twice
        count = min(abs(width - image.shape[1]), image.shape[1] // 2)
        order = _order(image.astype(np.float32).mean(2), count)
        times = np.where(order < count, 2 if width > image.shape[1] else 0, 1)
        rows = [np.repeat(line, k, axis=0) for line, k in zip(image, times, strict=True)]
        image = np.stack(rows)
    return image


@njit(cache=True)
def _order(grey: np.ndarray, count: int) -> np.ndarray:
    """When every pixel is removed, (H, W) int64; `count` for those that stay."""
    height, width = grey.shape
    order = np.full((height, width), count, np.int64)
    at = np.empty((height, width), np.int64)
    for x in range(width):
        at[:, x] = x
    left = width
    for k in range(count):
        energy = np.empty((height, left))
        for y in range(height):
            for x in range(left):
                here = grey[y, at[y, x]]
                energy[y, x] = abs(grey[y, at[y, min(x + 1, left - 1)]] - here)
                energy[y, x] += abs(grey[min(y + 1, height - 1), at[min(y + 1, height - 1), x]] - here)
        path = find_min_error_path(energy)
        for y in range(height):
            order[y, at[y, path[y]]] = k
            for x in range(path[y], left - 1):
                at[y, x] = at[y, x + 1]
        left -= 1
    return order
