"""Inpaint tile by tile: structure from the visible part, visible tiles fixed (tiles paper, section 4.3)."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, FloatArray, Int32Array, UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.labels import UNKNOWN
from facade_core.core.levelling import fill_unknown_values
from facade_core.core.types import Element, Lattice
from facade_core.facade.texture.genetic import POPULATION_SIZE, NodeConstraints, evolve_tilings
from facade_core.facade.texture.inpainting import (
    clip_to_visible_range,
    draw_guide,
    select_likely_elements,
    vote_across_bays,
)
from facade_core.facade.texture.tile_composition import compose_tiles
from facade_core.facade.texture.tiling_energy import label_histograms, tabulate_energy
from facade_core.parsing.lattice import lattice

_MAX_LOG_SIZE_RATIO = 0.35  # of a tile that may be warped into a hidden cell
_MAX_LABEL_DIFFERENCE = 0.2  # of exchangeable rows or columns of tiles, as a share of label area
_RIM_PX = 6


def inpaint_by_tiles(
    image: UInt8Array,
    mask: BoolArray,
    *,
    labels: UInt8Array | None = None,
    elements: Sequence[Element] = (),
    seed: int = 0,
) -> UInt8Array:
    """Fill the masked pixels of a facade by tiles; all other pixels keep their bits.

    Parameters
    ----------
    image, mask, labels, elements : as of `facade_core.facade.texture.inpainting.inpaint`; labels or elements are needed.
    seed : seed of the genetic algorithm.
    """
    guide = vote_across_bays(draw_guide(mask, labels, select_likely_elements(elements)), agreed=0.0)
    filled = fill_by_tiles(image, mask, guide, lattice(guide), np.random.default_rng(seed))
    return clip_to_visible_range(filled, image, mask)


def fill_by_tiles(
    image: UInt8Array, mask: BoolArray, labels: UInt8Array, grid: Lattice, rng: np.random.Generator
) -> UInt8Array:
    """Fill hidden pixels by tiles of a lattice.

    A tile is observed if no more than a twentieth of it is hidden. Only wholly visible tiles are copied; hidden
    pixels of others are diffused first, as colours fade over borders. Generations grow with the hidden nodes: 40
    each, 400 to 5000.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    mask : (H, W) bool, True where to fill.
    labels : (H, W) uint8 class ids.
    grid : lattice over the labels.
    rng : generator of the algorithm.

    Raises
    ------
    ImageError
        If no tile is wholly visible.
    """
    image = np.where(mask[..., None], np.rint(fill_unknown_values(image, ~mask)).astype(np.uint8), image)
    rows, columns = np.asarray(grid.rows), np.asarray(grid.columns)
    hidden = np.add.reduceat(np.add.reduceat(mask.astype(float), rows[:-1], 0), columns[:-1], 1)
    heights, widths = np.diff(rows), np.diff(columns)
    usable = hidden == 0
    frozen = hidden <= 0.05 * heights[:, None] * widths[None]
    if not usable.any():
        raise ImageError(
            "inpaint_by_tiles: no whole tile is visible outside the mask; use `inpaint` or retarget an exemplar"
        )
    tall, wide = usable.shape
    shares = label_histograms(labels, rows, columns).reshape(tall, wide, -1)
    may_row = (
        (np.abs(np.log(heights[:, None] / heights[None])) < _MAX_LOG_SIZE_RATIO)
        & usable.any(1)[None]
        & _similar_contents(shares)
    )
    may_column = (np.abs(np.log(widths[:, None] / widths[None])) < _MAX_LOG_SIZE_RATIO) & usable.any(0)[None]
    may_column &= _similar_contents(shares.transpose(1, 0, 2))
    for allowed, there, size in ((may_row, usable.any(1), heights), (may_column, usable.any(0), widths)):
        for k in np.flatnonzero(~allowed.any(1)):
            allowed[k, np.argmin(np.where(there, np.abs(np.log(size / size[k])), np.inf))] = True
    own = np.arange(tall * wide, dtype=np.int32).reshape(tall, wide)
    population = np.stack(
        [_initial_tiling(own, usable, frozen, may_row, may_column, rng) for _ in range(POPULATION_SIZE)]
    )
    tiles, _ = evolve_tilings(
        tabulate_energy(image, np.where(mask, UNKNOWN, labels), grid, usable=usable),
        population,
        NodeConstraints(may_row.astype(np.int64), may_column.astype(np.int64), frozen, usable),
        generations=int(np.clip(40 * (~frozen).sum(), 400, 5000)),
        rng=rng,
    )
    drawn, _ = compose_tiles(image, labels, grid, tiles, rows, columns)
    return _blend_hole(image, drawn, mask)


def _similar_contents(shares: FloatArray) -> BoolArray:
    """Return (n, n) bool: rows of tiles with the same labels in the same columns.

    Labels come from histograms (n, m, classes).
    """
    flat = shares.reshape(len(shares), -1)
    are_similar: BoolArray = np.abs(flat[:, None] - flat[None]).sum(2) < 2.0 * _MAX_LABEL_DIFFERENCE * shares.shape[1]
    return are_similar


def _initial_tiling(
    own: Int32Array,
    usable: BoolArray,
    frozen: BoolArray,
    may_row: BoolArray,
    may_column: BoolArray,
    rng: np.random.Generator,
) -> Int32Array:
    """Draw visible tiles for the hidden nodes, of the same row if one fits, else of the same column."""
    tiles = own.copy()
    anywhere = np.argwhere(usable)
    for y, x in np.argwhere(~frozen):
        same_row = np.flatnonzero(usable[y] & may_column[x])
        same_column = np.flatnonzero(usable[:, x] & may_row[y])
        if len(same_row):
            tiles[y, x] = own[y, rng.choice(same_row)]
        elif len(same_column):
            tiles[y, x] = own[rng.choice(same_column), x]
        elif usable[y].any():
            tiles[y, x] = own[y, rng.choice(np.flatnonzero(usable[y]))]
        else:
            tiles[y, x] = own[tuple(rng.choice(anywhere))]
    return tiles


def _blend_hole(image: UInt8Array, drawn: UInt8Array, mask: BoolArray) -> UInt8Array:
    """Return `drawn` in the hole, its colours adjusted to those of the rim, and `image` elsewhere."""
    kernel = np.ones((2 * _RIM_PX + 1, 2 * _RIM_PX + 1), np.uint8)
    rim = (cv2.dilate(mask.astype(np.uint8), kernel) > 0) & ~mask
    offset = diffuse_difference(image.astype(np.float32) - drawn, rim.astype(np.float32))
    filled = np.clip(np.rint(drawn + offset), 0, 255).astype(np.uint8)
    return np.where(mask[..., None], filled, image)


def diffuse_difference(difference: Float32Array, weight: Float32Array) -> Float32Array:
    """Diffuse colour differences known on a rim over the whole patch.

    A membrane by normalised convolution: near the rim its local mean, farther off the mean over an ever wider part of
    it. Differences are clipped, so that one misplaced edge does not bleed into the patch.

    Parameters
    ----------
    difference : (h, w, 3), valid where weight is positive.
    weight : (h, w).

    Returns
    -------
    (h, w, 3) float32.
    """
    weight = weight.astype(np.float32)
    clipped = np.asarray(np.clip(difference, -48.0, 48.0) * weight[..., None], np.float32)
    extent = float(max(difference.shape[:2]))
    sums, shares = np.zeros_like(clipped), np.zeros_like(weight)
    for sigma, share in ((4.0, 1.0), (16.0, 0.1), (max(48.0, extent / 2), 0.01)):
        sums += share * _blur(clipped, sigma)
        shares += share * _blur(weight, sigma)
    return np.asarray(sums / np.maximum(shares, 1e-6)[..., None], np.float32)


def _blur(array: Float32Array, sigma: float) -> Float32Array:
    """Blur by a Gaussian; large sigmas shrink the array first; zero outside."""
    factor = max(1, int(sigma // 4))
    height, width = array.shape[:2]
    small = cv2.resize(array, (-(-width // factor), -(-height // factor)), interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(small, (0, 0), sigma / factor, borderType=cv2.BORDER_CONSTANT)
    return np.asarray(cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR), array.dtype)
