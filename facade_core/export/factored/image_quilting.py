"""Tileable grain textures by image quilting on a torus.

Overlapping blocks of the free wall are joined along paths of least error; the last ones of a row and column meet the first.
Structures larger than `GrainSettings.shade_m` are removed before and after: repeated shade would be visible as a pattern.

References
----------
Efros and Freeman, "Image Quilting for Texture Synthesis and Transfer", 2001.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, FloatArray, Int64Array, UInt8Array
from facade_core.core.linear_light import smooth_known_light, srgb_to_linear
from facade_core.export.factored.settings import WALL_GRAINS


@dataclass(frozen=True, eq=False)
class WallGrain:
    """Tileable grain of a wall.

    Attributes
    ----------
    relative_light : (s, s, 3) float32 factor on the mean light.
    width_m : width and height on the wall, metres.
    """

    relative_light: Float32Array
    width_m: float


def synthesise_grain(image: UInt8Array, free: BoolArray, pixels_per_metre: float, seed: int) -> WallGrain:
    """Synthesise the grain of a picture; all ones if no block of it is free.

    Parameters
    ----------
    image : (h, w, 3) uint8.
    free : (h, w) bool, free wall.
    pixels_per_metre : resolution of the picture.
    seed : random seed.
    """
    import cv2

    side = min(
        WALL_GRAINS.texture_sides_px, key=lambda side: abs(np.log(side / (WALL_GRAINS.repeat_m * pixels_per_metre)))
    )
    wide = side / pixels_per_metre
    light = srgb_to_linear(image)
    shade = WALL_GRAINS.shade_m * pixels_per_metre
    flat = light / np.maximum(smooth_known_light(light, free, shade), 1e-3)
    rng = np.random.default_rng(seed)
    inside = cv2.integral(free.astype(np.uint8))
    for block in (block * side // WALL_GRAINS.texture_sides_px[-1] for block in WALL_GRAINS.block_sides_px):
        if min(free.shape) < block or block < WALL_GRAINS.min_block_px:
            continue
        full = inside[block:, block:] - inside[:-block, block:] - inside[block:, :-block] + inside[:-block, :-block]
        places = np.argwhere(full == block * block)
        if len(places) >= WALL_GRAINS.min_block_count:
            break
    else:
        return WallGrain(np.ones((side, side, 3), np.float32), wide)
    chosen = places[rng.permutation(len(places))[: WALL_GRAINS.max_blocks_tried]]
    patches = np.stack([flat[y : y + block, x : x + block] for y, x in chosen.tolist()])
    quilt = _quilt_torus(np.clip(patches, 1 / WALL_GRAINS.max_contrast, WALL_GRAINS.max_contrast), side, rng)
    quilt /= np.maximum(smooth_known_light(quilt, np.ones(quilt.shape[:2], bool), shade, wrap=True), 1e-3)
    return WallGrain(quilt / quilt.mean(axis=(0, 1)), wide)


def _quilt_torus(patches: Float32Array, side: int, rng: np.random.Generator) -> Float32Array:
    """Quilt blocks (n, b, b, 3) on a torus of `side` pixels."""
    block = patches.shape[1]
    count = -(-side * 4 // (block * 3))  # overlaps of a quarter at least
    starts = [k * side // count for k in range(count)]
    canvas, laid = np.zeros((side, side, 3), np.float32), np.zeros((side, side), bool)
    for top in starts:
        for left in starts:
            at = np.ix_((top + np.arange(block)) % side, (left + np.arange(block)) % side)
            there, known = canvas[at], laid[at]
            apart = np.zeros(len(patches))
            if known.any():
                rows, columns = np.nonzero(known)
                some = slice(None, None, max(1, len(rows) // 1500))
                off = patches[:, rows[some], columns[some]] - there[rows[some], columns[some]]
                apart = np.square(off).mean(axis=(1, 2))
            near = np.flatnonzero(apart <= WALL_GRAINS.max_error_factor * apart.min() + 1e-9)
            patch = patches[near[rng.integers(len(near))]]
            keep = known & ~_new_side_mask(np.square(patch - there).sum(axis=2), known)
            canvas[at] = np.where(keep[..., None], there, patch)
            laid[at] = True
    return canvas


def _new_side_mask(error: FloatArray, known: BoolArray) -> BoolArray:
    """Return where a new block replaces the old: beyond the path of least error on each side."""
    own = np.ones(known.shape, bool)
    for turn in range(4):
        turned, laid = np.rot90(error, turn), np.rot90(known, turn)
        strip = int(laid.all(axis=0).cumprod().sum())  # columns at the left that are laid wholly
        if 0 < strip < laid.shape[1]:
            beyond = np.arange(laid.shape[1]) >= _min_error_path(turned[:, :strip])[:, None]
            own &= np.rot90(beyond, -turn)
    return own


def _min_error_path(error: FloatArray) -> Int64Array:
    """Return the column (h,) of the path of least error down (h, w), with steps of at most one column."""
    height = len(error)
    cost = error.astype(np.float64).copy()
    for row in range(1, height):
        before = np.pad(cost[row - 1], 1, constant_values=np.inf)
        cost[row] += np.minimum(np.minimum(before[:-2], before[1:-1]), before[2:])
    path = np.empty(height, np.int64)
    path[-1] = int(cost[-1].argmin())
    for row in range(height - 2, -1, -1):
        low = max(0, path[row + 1] - 1)
        path[row] = low + int(cost[row, low : path[row + 1] + 2].argmin())
    return path
