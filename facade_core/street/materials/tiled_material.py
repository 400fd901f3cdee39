"""Tileable material from a picture, sampled over planes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import cv2
import numpy as np

from facade_core.core.arrays import Float32Array, Float64Array, Int64Array, UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.numba_cache import njit
from facade_core.facade.texture.seams import find_min_error_path
from facade_core.street.materials.settings import TILED_MATERIAL


class MipLevels(NamedTuple):
    """Mip levels of a tile as kernels read them; each level averages the previous one.

    Attributes
    ----------
    pixels : (p, 3) float32, all levels concatenated.
    first, rows, columns : (levels,) start and shape of each level.
    size : (2,) width and height of the tile, metres.
    """

    pixels: Float32Array
    first: Int64Array
    rows: Int64Array
    columns: Int64Array
    size: Float64Array


@dataclass(frozen=True)
class TiledMaterial:
    """Tileable picture of a material.

    Attributes
    ----------
    tile : (h, w, 3) float32, 0..255; wraps left-right and top-bottom.
    size : width and height, metres.
    """

    tile: Float32Array
    size: tuple[float, float]

    @classmethod
    def from_picture(cls, image: UInt8Array, metres_per_pixel: float, texels_per_metre: float) -> TiledMaterial:
        """Make a material from a picture (h, w, 3) uint8 for a texel density.

        Raises
        ------
        ImageError
            The picture has too few pixels.
        """
        if min(image.shape[:2]) < TILED_MATERIAL.min_side_px:
            raise ImageError(
                f"a material of {image.shape[1]} x {image.shape[0]} pixels shows nothing; give a larger picture"
            )
        tile = make_seamless(image)
        height, width = tile.shape[:2]
        size = (width * metres_per_pixel, height * metres_per_pixel)
        if (
            metres_per_pixel * texels_per_metre < 1
        ):  # finer than a texel: its means, or texels would pick pixels at random
            columns, rows = (max(1, round(side * texels_per_metre)) for side in size)
            smaller = np.asarray(cv2.resize(tile, (columns, rows), interpolation=cv2.INTER_AREA), tile.dtype)
            tile = smaller.reshape(rows, columns, 3)
        return cls(tile, size)

    def sample(self, across: Float64Array, down: Float64Array, footprint: Float64Array) -> Float64Array:
        """Sample the colour (n, 3) at coordinates and footprints (n,) of a plane, metres."""
        colours: Float64Array = _sample_points(self.mip_levels, across, down, footprint)
        return colours

    @cached_property
    def mip_levels(self) -> MipLevels:
        """Return the mip levels of the tile."""
        levels = [self.tile]
        while max(levels[-1].shape[:2]) > 1:
            rows, columns = (max(1, side // 2) for side in levels[-1].shape[:2])
            smaller = np.asarray(cv2.resize(levels[-1], (columns, rows), interpolation=cv2.INTER_AREA), self.tile.dtype)
            levels.append(smaller.reshape(rows, columns, 3))
        shapes = np.array([level.shape[:2] for level in levels])
        pixels = np.concatenate([level.reshape(-1, 3) for level in levels])
        area = shapes.prod(axis=1)
        return MipLevels(pixels, np.cumsum(area) - area, shapes[:, 0].copy(), shapes[:, 1].copy(), np.array(self.size))


@njit(cache=True)
def _sample_points(mips: MipLevels, across: Float64Array, down: Float64Array, footprint: Float64Array) -> Float64Array:
    out = np.empty((len(across), 3))
    for i in range(len(across)):
        out[i] = sample_mip_levels(mips, across[i], down[i], footprint[i])
    return out


@njit(cache=True, inline="always", error_model="numpy")
def sample_mip_levels(mips: MipLevels, across: float, down: float, footprint: float) -> tuple[float, float, float]:
    """Sample a colour bilinearly in the level whose pixels match the footprint.

    Called from numba kernels.
    """
    level, side = 0, max(mips.size[0] / mips.columns[0], mips.size[1] / mips.rows[0])
    while level + 1 < len(mips.first) and footprint > 1.42 * side:
        level, side = level + 1, 2 * side
    height, width, first = mips.rows[level], mips.columns[level], mips.first[level]
    x, y = across / mips.size[0] * width - 0.5, down / mips.size[1] * height - 0.5
    x0, y0 = int(np.floor(x)), int(np.floor(y))
    across_share, down_share = x - x0, y - y0
    left, right, top, bottom = x0 % width, (x0 + 1) % width, y0 % height, (y0 + 1) % height
    a, b = mips.pixels[first + top * width + left], mips.pixels[first + top * width + right]
    c, d = mips.pixels[first + bottom * width + left], mips.pixels[first + bottom * width + right]
    w00, w01, w10, w11 = (
        (1 - across_share) * (1 - down_share),
        across_share * (1 - down_share),
        (1 - across_share) * down_share,
        across_share * down_share,
    )
    return (
        w00 * a[0] + w01 * b[0] + w10 * c[0] + w11 * d[0],
        w00 * a[1] + w01 * b[1] + w10 * c[1] + w11 * d[1],
        w00 * a[2] + w01 * b[2] + w10 * c[2] + w11 * d[2],
    )


def make_seamless(image: UInt8Array) -> Float32Array:
    """Make a picture (h, w, 3) tileable: (h', w', 3) float32, a quarter smaller on both sides.

    Removes large-scale shading and joins opposite borders along the path of least difference.
    """
    flat = image.astype(np.float32)
    broad = cv2.GaussianBlur(flat, (0, 0), min(image.shape[:2]) / 4, borderType=cv2.BORDER_REFLECT)
    flat = np.clip(flat - broad + flat.mean(axis=(0, 1)), 0, 255)
    once = _join_borders(flat, around=False)
    return np.ascontiguousarray(_join_borders(once.transpose(1, 0, 2), around=True).transpose(1, 0, 2))


def _join_borders(image: Float32Array, *, around: bool) -> Float32Array:
    """Blend the right border of (h, w, 3) over the left one along a minimal path.

    `around` closes the path for wrapping rows.
    """
    height, width = image.shape[:2]
    strip = max(1, int(width * TILED_MATERIAL.join_share))
    left, right = image[:, :strip], image[:, width - strip :]
    error = ((left - right) ** 2).sum(axis=2).astype(np.float64)
    path = find_min_error_path(np.tile(error, (3, 1)))[height : 2 * height] if around else find_min_error_path(error)
    share = np.clip((np.arange(strip)[None, :] - path[:, None]) / (2 * TILED_MATERIAL.join_softness_px) + 0.5, 0, 1)[
        ..., None
    ].astype(np.float32)
    # at the ends of the overlap each border continues unchanged
    share[:, 0], share[:, -1] = np.minimum(share[:, 0], 0.5 if strip == 1 else 0), 1
    return np.concatenate([right * (1 - share) + left * share, image[:, strip : width - strip]], axis=1)
