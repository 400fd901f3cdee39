"""Grain by example: endless, non-periodic texture with the histogram of a photograph.

Random patches of a Gaussianised tileable example are blended over a triangle grid with preserved variance, then mapped
back to the example's values. Each level is the tile averaged over a larger box with its own inverse table, so that
averages over footprints stay correct. All arrays are (n,); lengths are metres.

References
----------
Heitz and Neyret 2018, High-performance by-example noise using a histogram-preserving blending operator.
Deliot and Heitz 2019, Procedural stochastic textures by tiling and blending.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from scipy import ndimage, special

from facade_core.core.arrays import Float32Array, Float64Array, Int64Array, UInt8Array
from facade_core.core.hash_uniform import COLUMN_FACTOR, SEED_FACTOR, hash_cell_row, hash_to_random_bits
from facade_core.core.numba_cache import njit
from facade_core.core.types import MATERIALS
from facade_core.street.materials.settings import GRAIN

# Shipped examples, in the order of the file.
EXAMPLE_NAMES = ("asphalt", "gravel", "grass", "earth", "concrete", "plaster-fine", "plaster-rough", "metal", "boards")
# Shipped example and weight of each grain, unless a block has its own picture. Pictures of tiles and stones show joints
# that conflict with the procedural ones, so these take a coarser concrete.
DEFAULT_EXAMPLES = {
    "asphalt": ("asphalt", 1.0),
    "gravel": ("gravel", 1.0),
    "grass": ("grass", 1.0),
    "slabs": ("concrete", 1.5),
    "setts": ("concrete", 2.5),
    "plaster-fine": ("plaster-fine", 1.0),
    "plaster-rough": ("plaster-rough", 2.0),
    "bricks": ("concrete", 2.5),
    "metal": ("metal", 0.7),
    "roof-tiles": ("concrete", 2.5),
    "slate": ("concrete", 3.0),
    "boards": ("boards", 1.6),
}
assert tuple(DEFAULT_EXAMPLES) == MATERIALS


class GrainKind(IntEnum):
    """Kinds of grain, in the order of `MATERIALS`."""

    ASPHALT = 0
    GRAVEL = 1
    GRASS = 2
    SLABS = 3
    SETTS = 4
    PLASTER_FINE = 5
    PLASTER_ROUGH = 6
    BRICKS = 7
    METAL = 8
    ROOF_TILES = 9
    SLATE = 10
    BOARDS = 11


# Side of a tile.
TILE_PIXELS = 256
# Levels; each box is wider than the previous one by the fourth root of 2.
GRAIN_LEVELS = 29
# Triangle edges per tile, so that a patch is not wider than the tile.
TRIANGLES_PER_TILE = 2 * np.sqrt(3)
_SKEW = 1 / np.sqrt(3)


class GrainExample(NamedTuple):
    """Gaussianised example of a surface.

    Attributes
    ----------
    tile : (TILE_PIXELS, TILE_PIXELS) uint8 Gaussian values.
    table : (256,) float32 tone of each value, around 0, relative to the mean.
    width : width of the tile, metres.
    colour : (3,) mean, 0..255.
    slope : (3,) change of each band with the tone, 1 for grey.
    """

    tile: UInt8Array
    table: Float32Array
    width: float
    colour: Float64Array
    slope: Float64Array


class GrainTables(NamedTuple):
    """Examples of all k grains as kernels read them.

    Attributes
    ----------
    values : (p,) uint8, all levels concatenated.
    first : (k, GRAIN_LEVELS) start of each level.
    bits : (k, GRAIN_LEVELS) binary logarithm of each level's side.
    tables : (k, GRAIN_LEVELS, 256) float32 inverse tables.
    width : (k,) width of a tile, metres.
    weight : (k,) factor of the tone.
    colour : (k, 3) 0..255 colour of a block's own picture, NaN without one.
    """

    values: UInt8Array
    first: Int64Array
    bits: Int64Array
    tables: Float32Array
    width: Float64Array
    weight: Float64Array
    colour: Float64Array


class WeightedGrain(NamedTuple):
    """Grain example of a material with the weight of its tone.

    Attributes
    ----------
    example : example that it takes.
    weight : factor of its tone.
    uses_colour : takes the example's colour too.
    """

    example: GrainExample
    weight: float = 1.0
    uses_colour: bool = False


def learn_grain(picture: UInt8Array, width: float, *, structure: float | None = None) -> GrainExample:
    """Learn a grain example from a tileable picture.

    Parameters
    ----------
    picture : (h, w, 3) uint8, tileable; h is w divided by an integer.
    width : metres.
    structure : removes structures larger than this, metres, where joints are drawn procedurally.
    """
    import cv2

    square = np.tile(picture, (max(1, picture.shape[1] // picture.shape[0]), 1, 1))
    small = cv2.resize(square, (TILE_PIXELS, TILE_PIXELS), interpolation=cv2.INTER_AREA).astype(np.float64)
    colour = small.mean(axis=(0, 1))
    tone = small.mean(axis=2) / colour.mean() - 1
    if structure is not None:
        tone -= ndimage.gaussian_filter(tone, structure / width * TILE_PIXELS, mode="wrap")
        low, high = np.percentile(tone, (2, 98))  # edges of the removed structures
        tone = np.clip(tone, low, high)
        tone -= tone.mean()
    bands = small / colour - 1
    slope = (bands * tone[..., None]).mean(axis=(0, 1)) / np.square(tone).mean() if structure is None else np.ones(3)
    order = np.argsort(tone, axis=None, kind="stable")
    share = (np.arange(tone.size) + 0.5) / tone.size
    gaussian = np.empty(tone.size)
    gaussian[order] = special.ndtri(share)
    tile = np.clip(np.rint(128 + GRAIN.values_per_sd * gaussian), 0, 255).astype(np.uint8).reshape(tone.shape)
    shares = special.ndtr((np.arange(256) - 128) / GRAIN.values_per_sd)
    table = np.interp(shares, share, tone.reshape(-1)[order]).astype(np.float32)
    return GrainExample(tile, table, width, colour, slope)


def build_grain_tables(kinds: Sequence[WeightedGrain]) -> GrainTables:
    """Build the kernel tables of grains. A shared example is stored once."""
    examples = {id(grain.example): grain.example for grain in kinds}
    values, first, bits, tables, start = [], [], [], [], 0
    for example in examples.values():
        gaussian = (example.tile.astype(np.float64) - 128) / GRAIN.values_per_sd
        transformed = np.fft.rfft2(gaussian - gaussian.mean())
        for level in range(GRAIN_LEVELS):
            box = 2 ** (level / 4)
            # a pixel already averages over its own area
            down, across = (
                np.sinc(f * box) / np.sinc(f) for f in (np.fft.fftfreq(TILE_PIXELS), np.fft.rfftfreq(TILE_PIXELS))
            )
            window = np.outer(down, across)
            averaged = np.fft.irfft2(transformed * window, gaussian.shape)
            sd = max(float(averaged.std()), 1e-6)
            side = min(TILE_PIXELS, max(8, 2 ** int(np.ceil(np.log2(GRAIN.pixels_per_box * TILE_PIXELS / box)))))
            every = TILE_PIXELS // side
            picked = averaged[every // 2 :: every, every // 2 :: every] / sd
            values.append(np.clip(np.rint(128 + GRAIN.values_per_sd * picked), 0, 255).astype(np.uint8).reshape(-1))
            first.append(start)
            bits.append(side.bit_length() - 1)
            start += side * side
            tables.append(_averaged_table(example.table.astype(np.float64), min(sd, 1.0)))
    row = [list(examples).index(id(grain.example)) for grain in kinds]
    shape = (len(examples), GRAIN_LEVELS)
    unknown = np.full(3, np.nan)
    return GrainTables(
        np.concatenate(values),
        np.array(first).reshape(shape)[row],
        np.array(bits).reshape(shape)[row],
        np.array(tables, np.float32).reshape(*shape, 256)[row],
        np.array([grain.example.width for grain in kinds]),
        np.array([grain.weight for grain in kinds]),
        np.array([grain.example.colour if grain.uses_colour else unknown for grain in kinds]),
    )


def _averaged_table(table: Float64Array, sd: float) -> Float64Array:
    """Return the inverse table of a level whose values have a deviation of `sd`.

    The rest of the variance is inside the box.
    """
    within = np.sqrt(max(1 - sd * sd, 0.0))
    nodes, weights = np.polynomial.hermite_e.hermegauss(15)
    value = sd * (np.arange(256) - 128)[:, None] + within * GRAIN.values_per_sd * nodes
    averaged: Float64Array = (np.interp(value, np.arange(256) - 128, table) * (weights / weights.sum())).sum(axis=1)
    return averaged


@njit(cache=True, nogil=True, error_model="numpy")
def add_grain(
    x: Float64Array,
    y: Float64Array,
    side: Float64Array,
    grains: GrainTables,
    which: int,
    weight: float,
    seed: int,
    out: Float64Array,
) -> None:
    """Add the weighted tone of a grain to `out`.

    Parameters
    ----------
    x, y : (n,) coordinates, metres.
    side : (n,) footprints, metres.
    grains : tables of all grains.
    which : `GrainKind`.
    weight : factor of the tone.
    seed : random seed.
    out : (n,) tones, changed in place.
    """
    weight *= grains.weight[which]
    across, row_seed = 1 / grains.width[which], np.uint64(seed) * SEED_FACTOR
    level, box, known, left = 0, 0.0, -1.0, weight
    first, bits, table = grains.first[which, 0], np.int64(0), grains.tables[which, 0]
    for k in range(len(x)):
        if side[k] != known:
            known, level, box = side[k], 0, 1.0905 * grains.width[which] / TILE_PIXELS
            while level + 1 < GRAIN_LEVELS and known > box:
                level, box = level + 1, 1.189207115002721 * box
            left = weight * min(box / known, 1.0)  # a footprint larger than the largest box has the mean of several
            first, bits, table = grains.first[which, level], grains.bits[which, level], grains.tables[which, level]
        u, v = x[k] * across, y[k] * across
        # the triangle and the weights of its corners
        a, b = (u - _SKEW * v) * TRIANGLES_PER_TILE, 2 * _SKEW * v * TRIANGLES_PER_TILE
        column, row = np.floor(a), np.floor(b)
        a, b = a - column, b - row
        third = 1 - a - b
        upper = third < 0
        flipped = np.float64(upper)
        w0, w1, w2 = abs(third), abs(b - flipped), abs(a - flipped)
        w0, w1, w2 = w0 * w0, w1 * w1, w2 * w2
        norm = 1 / np.sqrt(w0 * w0 + w1 * w1 + w2 * w2)
        flip = np.int64(upper)
        i, j = np.int64(column), np.int64(row)
        total = 0.0
        mask = (np.int64(1) << bits) - 1
        length = np.float64(mask + 1)
        for corner in range(3):
            if corner == 0:
                ci, cj, w = i + flip, j + flip, w0
            elif corner == 1:
                ci, cj, w = i + flip, j + 1 - flip, w1
            else:
                ci, cj, w = i + 1 - flip, j + flip, w2
            h = hash_to_random_bits(np.uint64(ci) * COLUMN_FACTOR + hash_cell_row(np.float64(cj), row_seed))
            right = np.float64(np.int64(h & np.uint64(0xFFFF))) * (1.0 / 65536.0)
            down = np.float64(np.int64((h >> np.uint64(16)) & np.uint64(0xFFFF))) * (1.0 / 65536.0)
            px = np.int64(np.floor((u + right) * length)) & mask
            py = np.int64(np.floor((v + down) * length)) & mask
            total += w * (np.float64(grains.values[first + (py << bits) + px]) - 128.0)
        value = min(max(128.0 + total * norm, 0.0), 254.999)
        below = np.int64(value)
        part = value - below
        out[k] += left * ((1 - part) * table[below] + part * table[below + 1])
