"""Grain by example: the texture of a photograph without an end, with its histogram and without its period.

Patches of an example whose values are made Gaussian, cut at random from a tile that goes on into itself, are blended over a
grid of triangles so that their variance stays, and brought back to the example's values (Heitz and Neyret 2018; Deliot and
Heitz 2019). Every level is the tile meant over a larger box, with a table of its own for the way back, so that means over
footprints stay true. All arrays are (n,); lengths are metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import ndimage, special

from facade_core.core.hash_uniform import COLUMN_FACTOR, SEED_FACTOR, hash_bits, hash_row
from facade_core.core.numba_cache import njit
from facade_core.core.types import MATERIALS

# The examples that are shipped, in the order of the file.
EXAMPLE_NAMES = ("asphalt", "gravel", "grass", "earth", "concrete", "plaster-fine", "plaster-rough", "metal", "boards")
# Of what has grain the shipped example that it takes where a block has no picture of its own, and how much of that. Pictures of
# what is laid show joints askew to those that are laid by rule, so tiles and stones take concrete's, coarser.
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
ASPHALT, GRAVEL, GRASS, SLABS, SETTS, PLASTER_FINE, PLASTER_ROUGH, BRICKS, METAL, ROOF_TILES, SLATE, BOARDS = range(
    len(DEFAULT_EXAMPLES)
)
# Pixels along a tile's sides; values of a byte to a standard deviation, about 128; levels, of which a box is wider than the one
# before by the fourth root of 2.
TILE_PIXELS, VALUES_PER_SD, GRAIN_LEVELS = 256, 42, 29
# A level keeps this many pixels along its box, so that the nearest one is near enough.
PIXELS_PER_BOX = 4
# Triangles have edges of 1 / GRID tiles: a patch is no wider than the tile.
TRIANGLES_PER_TILE = 2 * np.sqrt(3)
_SKEW = 1 / np.sqrt(3)


class GrainExample(NamedTuple):
    """tile (TILE_PIXELS, TILE_PIXELS) uint8: the Gaussian values; table (256,) float32: the tone of each, around 0, a share of the mean;
    width: of the tile, metres; colour (3,): its mean, 0..255; slope (3,): how far its bands go with the tone, 1 of a grey."""

    tile: np.ndarray
    table: np.ndarray
    width: float
    colour: np.ndarray
    slope: np.ndarray


class GrainTables(NamedTuple):
    """Examples as kernels read them: k of them, each with its levels.

    values (p,) uint8, one level after the other; first, bits (k, GRAIN_LEVELS): where each begins, and the power of 2 of its side;
    tables (k, GRAIN_LEVELS, 256) float32; width (k,): of a tile, metres; weight (k,): how much of its tone; colour (k, 3): that of a
    block's own picture, 0..255, NaN where it has none.
    """

    values: np.ndarray
    first: np.ndarray
    bits: np.ndarray
    tables: np.ndarray
    width: np.ndarray
    weight: np.ndarray
    colour: np.ndarray


class Grain(NamedTuple):
    """What has grain: of an example so much, and whether its colour too."""

    example: GrainExample
    weight: float = 1.0
    coloured: bool = False


def learn_grain(picture: np.ndarray, width: float, *, structure: float | None = None) -> GrainExample:
    """An example from a picture (h, w, 3) uint8 that goes on into itself and is `width` metres wide, and as high as that or a
    half, a third, ... of it.

    structure: what is larger than this, metres, is taken out, where joints are laid by a rule and only grain is wanted.
    """
    import cv2

    square = np.tile(picture, (max(1, picture.shape[1] // picture.shape[0]), 1, 1))
    small = cv2.resize(square, (TILE_PIXELS, TILE_PIXELS), interpolation=cv2.INTER_AREA).astype(np.float64)
    colour = small.mean(axis=(0, 1))
    tone = small.mean(axis=2) / colour.mean() - 1
    if structure is not None:
        tone -= ndimage.gaussian_filter(tone, structure / width * TILE_PIXELS, mode="wrap")
        low, high = np.percentile(tone, (2, 98))  # edges of what was taken out
        tone = np.clip(tone, low, high)
        tone -= tone.mean()
    bands = small / colour - 1
    slope = (bands * tone[..., None]).mean(axis=(0, 1)) / np.square(tone).mean() if structure is None else np.ones(3)
    order = np.argsort(tone, axis=None, kind="stable")
    share = (np.arange(tone.size) + 0.5) / tone.size
    gaussian = np.empty(tone.size)
    gaussian[order] = special.ndtri(share)
    tile = np.clip(np.rint(128 + VALUES_PER_SD * gaussian), 0, 255).astype(np.uint8).reshape(tone.shape)
    shares = special.ndtr((np.arange(256) - 128) / VALUES_PER_SD)
    table = np.interp(shares, share, tone.reshape(-1)[order]).astype(np.float32)
    return GrainExample(tile, table, width, colour, slope)


def build_grain_tables(kinds: Sequence[Grain]) -> GrainTables:
    """What has grain as kernels read it, with the levels of each example; one that several take is there once."""
    examples = {id(one.example): one.example for one in kinds}
    values, first, bits, tables, start = [], [], [], [], 0
    for example in examples.values():
        gaussian = (example.tile.astype(np.float64) - 128) / VALUES_PER_SD
        transformed = np.fft.rfft2(gaussian - gaussian.mean())
        for level in range(GRAIN_LEVELS):
            box = 2 ** (level / 4)
            # a pixel's value is a mean over the pixel already
            down, across = (np.sinc(f * box) / np.sinc(f) for f in (np.fft.fftfreq(TILE_PIXELS), np.fft.rfftfreq(TILE_PIXELS)))
            window = np.outer(down, across)
            meant = np.fft.irfft2(transformed * window, gaussian.shape)
            sd = max(float(meant.std()), 1e-6)
            side = min(TILE_PIXELS, max(8, 2 ** int(np.ceil(np.log2(PIXELS_PER_BOX * TILE_PIXELS / box)))))
            every = TILE_PIXELS // side
            picked = meant[every // 2 :: every, every // 2 :: every] / sd
            values.append(np.clip(np.rint(128 + VALUES_PER_SD * picked), 0, 255).astype(np.uint8).reshape(-1))
            first.append(start)
            bits.append(side.bit_length() - 1)
            start += side * side
            tables.append(_averaged_table(example.table.astype(np.float64), min(sd, 1.0)))
    row = [list(examples).index(id(one.example)) for one in kinds]
    shape = (len(examples), GRAIN_LEVELS)
    unknown = np.full(3, np.nan)
    return GrainTables(
        np.concatenate(values),
        np.array(first).reshape(shape)[row],
        np.array(bits).reshape(shape)[row],
        np.array(tables, np.float32).reshape(*shape, 256)[row],
        np.array([one.example.width for one in kinds]),
        np.array([one.weight for one in kinds]),
        np.array([one.example.colour if one.coloured else unknown for one in kinds]),
    )


def _averaged_table(table: np.ndarray, sd: float) -> np.ndarray:
    """The table of a level whose values have this deviation of the example's 1: the rest of it lies within the box."""
    within = np.sqrt(max(1 - sd * sd, 0.0))
    nodes, weights = np.polynomial.hermite_e.hermegauss(15)
    at = sd * (np.arange(256) - 128)[:, None] + within * VALUES_PER_SD * nodes
    return np.interp(at, np.arange(256) - 128, table) @ (weights / weights.sum())


@njit(cache=True, nogil=True, error_model="numpy")
def add_grain(
    x: np.ndarray,
    y: np.ndarray,
    side: np.ndarray,
    grains: GrainTables,
    which: int,
    weight: float,
    seed: int,
    out: np.ndarray,
) -> None:
    """Add weight times the tone of what has this grain, around 0, a share of its mean."""
    weight *= grains.weight[which]
    across, own = 1 / grains.width[which], np.uint64(seed) * SEED_FACTOR
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
        # the triangle, its corners and how near each is
        a, b = (u - _SKEW * v) * TRIANGLES_PER_TILE, 2 * _SKEW * v * TRIANGLES_PER_TILE
        column, row = np.floor(a), np.floor(b)
        a, b = a - column, b - row
        third = 1 - a - b
        upper = third < 0
        one = np.float64(upper)
        w0, w1, w2 = abs(third), abs(b - one), abs(a - one)
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
            h = hash_bits(np.uint64(ci) * COLUMN_FACTOR + hash_row(np.float64(cj), own))
            right = np.float64(np.int64(h & np.uint64(0xFFFF))) * (1.0 / 65536.0)
            down = np.float64(np.int64((h >> np.uint64(16)) & np.uint64(0xFFFF))) * (1.0 / 65536.0)
            px = np.int64(np.floor((u + right) * length)) & mask
            py = np.int64(np.floor((v + down) * length)) & mask
            total += w * (np.float64(grains.values[first + (py << bits) + px]) - 128.0)
        found = min(max(128.0 + total * norm, 0.0), 254.999)
        below = np.int64(found)
        part = found - below
        out[k] += left * ((1 - part) * table[below] + part * table[below + 1])
