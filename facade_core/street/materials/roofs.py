"""Procedural roofs, one kernel each.

Sheet metal, tiles, slates, felt, gravel, patches, dried pools and moss. All arrays are (n,); lengths are metres; a
footprint is the side of a square, greater than 0. x runs along the eaves and y down.
"""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Float64Array
from facade_core.core.hash_uniform import COLUMN_FACTOR, SEED_FACTOR, hash_cell_row, hash_to_uniform
from facade_core.core.numba_cache import njit
from facade_core.street.materials.patterns import add_noise, add_piece_tones, running_bond_stone_share, stripe_share
from facade_core.street.materials.settings import ROOF_MATERIALS

# Muted roofs: sheet metal; red, brown and grey tiles; slate, bitumen felt and gravel.
SHEET_METAL_PALETTE = np.array([[92, 74, 66], [104, 106, 108], [72, 78, 80], [122, 82, 66], [86, 96, 88]], np.float64)
ROOF_TILE_PALETTE = np.array([[148, 86, 66], [120, 70, 58], [96, 74, 66], [78, 76, 76], [104, 96, 90]], np.float64)
SLATE_PALETTE = np.array([[84, 88, 94], [74, 78, 82], [92, 92, 98], [70, 76, 74]], np.float64)
FELT_PALETTE = np.array([[82, 80, 78], [98, 95, 91], [70, 70, 71], [104, 106, 104]], np.float64)
ROOF_GRAVEL_PALETTE = np.array([[132, 126, 116], [118, 114, 106], [146, 137, 122]], np.float64)
# Colour of a tone of 1.
MOSS_COLOUR = np.array([82.0, 88.0, 54.0])


@njit(cache=True, nogil=True, error_model="numpy")
def sheet_metal_tone(x: Float64Array, y: Float64Array, side: Float64Array, seed: int, out: Float64Array) -> None:
    """Write tones of a sheet-metal roof with standing seams every 0.6 m."""
    for k in range(len(x)):
        out[k] = 1 - 0.12 * stripe_share(
            x[k] / ROOF_MATERIALS.sheet_m,
            side[k] / ROOF_MATERIALS.sheet_m,
            -0.04 / ROOF_MATERIALS.sheet_m,
            0.08 / ROOF_MATERIALS.sheet_m,
        )
    add_noise(x, y, side, (0.8, 0.8), 0.05, seed + 7, out)
    add_noise(x, y, side, (5.0, 5.0), 0.05, seed + 8, out)


@njit(cache=True, nogil=True, error_model="numpy")
def roof_tile_tone(x: Float64Array, y: Float64Array, side: Float64Array, seed: int, out: Float64Array) -> None:
    """Write tones of a clay tile roof with rows that overlap down the slope."""
    across, down = 1 / ROOF_MATERIALS.tile_m[0], 1 / ROOF_MATERIALS.tile_m[1]
    for k in range(len(x)):
        column, row, wide, high = x[k] * across, y[k] * down, side[k] * across, side[k] * down
        # a cubic wave, nearly a cosine: highest in a tile's middle, shifted by half a tile in odd rows
        even = stripe_share(0.5 * row, 0.5 * high, 0.0, 0.5)
        away = 2 * abs(column - np.floor(column + 0.5))
        wave = 1 - 2 * away * away * (3 - 2 * away)
        # averaged over a share w of a period it is lower by sin(pi w) / (pi w)
        square = min(wide * wide, 1.0)
        wave *= (1 - square) * (1 - 0.6449 * square + 0.19 * square * square)
        out[k] = 1 + 0.05 * (1 - 2 * even) * wave - 0.22 * stripe_share(row, high, 0.86, 0.14)
    add_piece_tones(x, y, side, ROOF_MATERIALS.tile_m, 0.10, seed + 23, out)
    add_noise(x, y, side, (0.8, 0.8), 0.04, seed + 29, out)
    add_noise(x, y, side, (5.0, 5.0), 0.04, seed + 30, out)


@njit(cache=True, nogil=True, error_model="numpy")
def slate_tone(x: Float64Array, y: Float64Array, side: Float64Array, seed: int, out: Float64Array) -> None:
    """Write tones of a slate roof with slates of varied grey and thin edge shadows."""
    out[:] = 1.0
    add_noise(x, y, side, (1.6, 1.1), 0.06, seed + 91, out)
    add_noise(x, y, side, (6.0, 6.0), 0.06, seed + 92, out)
    add_piece_tones(x, y, side, ROOF_MATERIALS.slate_m, 0.34, seed + 93, out)
    across, down = 1 / ROOF_MATERIALS.slate_m[0], 1 / ROOF_MATERIALS.slate_m[1]
    for k in range(len(x)):
        column, row, wide, high = x[k] * across, y[k] * down, side[k] * across, side[k] * down
        clear = running_bond_stone_share(column, row, wide, high, ROOF_MATERIALS.slate_gap_m, across, down)
        out[k] *= (0.62 + 0.38 * clear) * (1 - 0.2 * stripe_share(row, high, 0.9, 0.1))


@njit(cache=True, nogil=True, error_model="numpy")
def felt_tone(x: Float64Array, y: Float64Array, side: Float64Array, seed: int, out: Float64Array) -> None:
    """Write tones of bitumen felt: overlapping sheets along y, patches and dried pools."""
    out[:] = 1.0
    add_noise(x, y, side, (1.7, 1.7), 0.04, seed + 95, out)
    add_noise(x, y, side, (6.0, 6.0), 0.05, seed + 96, out)
    add_piece_tones(y, x, side, (ROOF_MATERIALS.felt_m[1], ROOF_MATERIALS.felt_m[0]), 0.11, seed + 101, out)
    add_repair_patches(x, y, side, seed + 102, out)
    add_pool_stains(x, y, side, seed + 105, out)
    across, down = 1 / ROOF_MATERIALS.felt_m[1], 1 / ROOF_MATERIALS.felt_m[0]
    for k in range(len(x)):
        clear = running_bond_stone_share(
            y[k] * across, x[k] * down, side[k] * across, side[k] * down, ROOF_MATERIALS.felt_lap_m, across, down
        )
        out[k] *= 0.84 + 0.16 * clear


@njit(cache=True, nogil=True, error_model="numpy")
def roof_gravel_tone(x: Float64Array, y: Float64Array, side: Float64Array, seed: int, out: Float64Array) -> None:
    """Write tones of a flat gravel roof with thin places and dried pools."""
    out[:] = 1.0
    add_noise(x, y, side, (0.9, 0.9), 0.05, seed + 108, out)
    add_noise(x, y, side, (7.0, 7.0), 0.08, seed + 109, out)
    add_pool_stains(x, y, side, seed + 105, out)


@njit(cache=True, nogil=True, error_model="numpy")
def add_repair_patches(x: Float64Array, y: Float64Array, side: Float64Array, seed: int, out: Float64Array) -> None:
    """Add tones of repaired patches, -0.12..0.12: at most one rectangle per cell, well inside it.

    Patches fade with the footprint until half a cell, so that no footprint reaches a neighbouring cell's patch.
    """
    row_seed = np.uint64(seed) * SEED_FACTOR
    for k in range(len(x)):
        u, v = x[k] / ROOF_MATERIALS.patch_cell_m, y[k] / ROOF_MATERIALS.patch_cell_m
        column, row = np.floor(u), np.floor(v)
        h = np.uint64(np.int64(column)) * COLUMN_FACTOR + hash_cell_row(row, row_seed)
        has_patch = np.float64(hash_to_uniform(h) < ROOF_MATERIALS.patch_share)
        wide, long = 0.12 + 0.3 * hash_to_uniform(h + np.uint64(1)), 0.1 + 0.25 * hash_to_uniform(h + np.uint64(2))
        left, low = (
            0.1 + (0.8 - wide) * hash_to_uniform(h + np.uint64(3)),
            0.1 + (0.8 - long) * hash_to_uniform(h + np.uint64(4)),
        )
        size = side[k] / ROOF_MATERIALS.patch_cell_m
        u, v = u - column, v - row
        overlap_u = max(min(u + 0.5 * size, left + wide) - max(u - 0.5 * size, left), 0.0)
        overlap_v = max(min(v + 0.5 * size, low + long) - max(v - 0.5 * size, low), 0.0)
        fade = min(max(2.0 - 4.0 * size, 0.0), 1.0)
        out[k] += (
            fade * has_patch * 0.24 * (hash_to_uniform(h + np.uint64(5)) - 0.5) * overlap_u * overlap_v / (size * size)
        )


@njit(cache=True, nogil=True, error_model="numpy")
def add_pool_stains(x: Float64Array, y: Float64Array, side: Float64Array, seed: int, out: Float64Array) -> None:
    """Add dried pools of a flat roof: darker floors with pale silt along the edge.

    A footprint as wide as a shore gets the mean of the roof.
    """
    depth = np.zeros(len(x))
    for number in range(3):
        add_noise(
            x,
            y,
            side,
            (ROOF_MATERIALS.pool_cells_m[number], ROOF_MATERIALS.pool_cells_m[number]),
            ROOF_MATERIALS.pool_weights[number],
            seed + number,
            depth,
        )
    for k in range(len(x)):
        wet = min(max((depth[k] - ROOF_MATERIALS.shore_depth) / ROOF_MATERIALS.shore_width, 0.0), 1.0)
        fine = min(max(2.0 - 2.0 * side[k], 0.0), 1.0)
        pooled, shore = (
            ROOF_MATERIALS.mean_pool_share + fine * (wet - ROOF_MATERIALS.mean_pool_share),
            ROOF_MATERIALS.mean_shore_share + fine * (4 * wet * (1 - wet) - ROOF_MATERIALS.mean_shore_share),
        )
        out[k] += 0.09 * shore - 0.1 * pooled


@njit(cache=True, nogil=True, error_model="numpy")
def moss_share(
    x: Float64Array, y: Float64Array, side: Float64Array, max_share: float, seed: int, out: Float64Array
) -> None:
    """Write the share of a roof under moss, in cushions along the courses.

    Parameters
    ----------
    x, y : (n,) coordinates along the eaves and down, metres.
    side : (n,) footprints, metres.
    max_share : share at the worst place.
    seed : random seed.
    out : (n,) output share.
    """
    out[:] = -0.25
    add_noise(x, y, side, (2.6, 1.7), 0.75, seed + 59, out)
    add_noise(x, y, side, (0.3, 0.22), 0.45, seed + 60, out)
    for k in range(len(x)):
        out[k] = max_share * min(max(2 * out[k], 0.0), 1.0)
