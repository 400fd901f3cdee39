"""A material from a picture of it: cut so that it goes on without a seam, and laid over planes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import cv2
import numpy as np

from facade_core.core.errors import ImageError
from facade_core.core.numba_cache import njit
from facade_core.facade.texture.seams import least_path

# Share of a picture's side within which its opposite borders are joined, and pixels over which the join is soft.
JOIN_SHARE, JOIN_SOFTNESS_PX = 0.25, 2
MIN_SIDE_PX = 8


class MipLevels(NamedTuple):
    """A tile at its own size and at halves of that, each the means of the one before, as kernels read them.

    pixels (p, 3) float32, one tile after the other;
    first, rows, columns (levels,): where each begins, and its shape;
    size (2,): width and height of all of them, metres.
    """

    pixels: np.ndarray
    first: np.ndarray
    rows: np.ndarray
    columns: np.ndarray
    size: np.ndarray


@dataclass(frozen=True)
class TiledMaterial:
    """A tile (h, w, 3) float32, 0..255, that goes on to the right into its left and down into its top; size (2,) is its width
    and height in metres."""

    tile: np.ndarray
    size: tuple[float, float]

    @classmethod
    def of(cls, image: np.ndarray, metres_per_pixel: float, texels_per_metre: float) -> TiledMaterial:
        """A picture (h, w, 3) uint8 of a material, for texels of a density. Raises ImageError for one of a few pixels."""
        if min(image.shape[:2]) < MIN_SIDE_PX:
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
            tile = cv2.resize(tile, (columns, rows), interpolation=cv2.INTER_AREA).reshape(rows, columns, 3)
        return cls(tile, size)

    def laid(self, across: np.ndarray, down: np.ndarray, footprint: np.ndarray) -> np.ndarray:
        """Colour (n, 3) at places of a plane, metres to the right and down, with footprints, metres, (n,) each."""
        return _sample_points(self.mips, across, down, footprint)

    @cached_property
    def mips(self) -> MipLevels:
        levels = [self.tile]
        while max(levels[-1].shape[:2]) > 1:
            rows, columns = (max(1, side // 2) for side in levels[-1].shape[:2])
            smaller = cv2.resize(levels[-1], (columns, rows), interpolation=cv2.INTER_AREA)
            levels.append(smaller.reshape(rows, columns, 3))
        shapes = np.array([level.shape[:2] for level in levels])
        pixels = np.concatenate([level.reshape(-1, 3) for level in levels])
        area = shapes.prod(axis=1)
        return MipLevels(pixels, np.cumsum(area) - area, shapes[:, 0].copy(), shapes[:, 1].copy(), np.array(self.size))


@njit(cache=True)
def _sample_points(mips: MipLevels, across: np.ndarray, down: np.ndarray, footprint: np.ndarray) -> np.ndarray:
    out = np.empty((len(across), 3))
    for i in range(len(across)):
        out[i] = sample_mip_levels(mips, across[i], down[i], footprint[i])
    return out


@njit(cache=True, inline="always", error_model="numpy")
def sample_mip_levels(mips: MipLevels, across: float, down: float, footprint: float) -> tuple[float, float, float]:
    """Colour at a place of a plane: bilinear in the tile whose pixels are about as large as the footprint, or the largest tile.
    Called from numba kernels."""
    level, side = 0, max(mips.size[0] / mips.columns[0], mips.size[1] / mips.rows[0])
    while level + 1 < len(mips.first) and footprint > 1.42 * side:
        level, side = level + 1, 2 * side
    height, width, first = mips.rows[level], mips.columns[level], mips.first[level]
    x, y = across / mips.size[0] * width - 0.5, down / mips.size[1] * height - 0.5
    x0, y0 = int(np.floor(x)), int(np.floor(y))
    beside, below = x - x0, y - y0
    left, right, top, bottom = x0 % width, (x0 + 1) % width, y0 % height, (y0 + 1) % height
    a, b = mips.pixels[first + top * width + left], mips.pixels[first + top * width + right]
    c, d = mips.pixels[first + bottom * width + left], mips.pixels[first + bottom * width + right]
    w00, w01, w10, w11 = (1 - beside) * (1 - below), beside * (1 - below), (1 - beside) * below, beside * below
    return (
        w00 * a[0] + w01 * b[0] + w10 * c[0] + w11 * d[0],
        w00 * a[1] + w01 * b[1] + w10 * c[1] + w11 * d[1],
        w00 * a[2] + w01 * b[2] + w10 * c[2] + w11 * d[2],
    )


def make_seamless(image: np.ndarray) -> np.ndarray:
    """A picture (h, w, 3) as a tile that goes on into itself, (h', w', 3) float32: a quarter less of either side.

    Light that changes over the whole picture is evened out; opposite borders are joined along the path where they differ least.
    """
    flat = image.astype(np.float32)
    broad = cv2.GaussianBlur(flat, (0, 0), min(image.shape[:2]) / 4, borderType=cv2.BORDER_REFLECT)
    flat = np.clip(flat - broad + flat.mean(axis=(0, 1)), 0, 255)
    once = _join_borders(flat, around=False)
    return np.ascontiguousarray(_join_borders(once.transpose(1, 0, 2), around=True).transpose(1, 0, 2))


def _join_borders(image: np.ndarray, *, around: bool) -> np.ndarray:
    """The right border of (h, w, 3) laid over the left one, along the path of least difference from top to bottom; `around`
    where the rows go on into themselves, so that the path must too."""
    height, width = image.shape[:2]
    strip = max(1, int(width * JOIN_SHARE))
    left, right = image[:, :strip], image[:, width - strip :]
    error = ((left - right) ** 2).sum(axis=2).astype(np.float64)
    path = least_path(np.tile(error, (3, 1)))[height : 2 * height] if around else least_path(error)
    share = np.clip((np.arange(strip)[None, :] - path[:, None]) / (2 * JOIN_SOFTNESS_PX) + 0.5, 0, 1)[..., None].astype(np.float32)
    # the join never shows at its ends: there the one border goes on as it was, and the other begins
    share[:, 0], share[:, -1] = np.minimum(share[:, 0], 0.5 if strip == 1 else 0), 1
    return np.concatenate([right * (1 - share) + left * share, image[:, strip : width - strip]], axis=1)
