"""A material from a picture of it: cut so that it goes on without a seam, and laid over planes."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from facade_core.errors import ImageError
from facade_core.texture.seams import least_path

# Share of a picture's side within which its opposite borders are joined, and pixels over which the join is soft.
JOINED, SOFT = 0.25, 2
LEAST_PIXELS = 8


@dataclass(frozen=True)
class Material:
    """A tile (h, w, 3) float32, 0..255, that goes on to the right into its left and down into its top; size (2,) is its width
    and height in metres."""

    tile: np.ndarray
    size: tuple[float, float]

    @classmethod
    def of(cls, image: np.ndarray, metres_per_pixel: float, texels_per_metre: float) -> Material:
        """A picture (h, w, 3) uint8 of a material, for texels of a density. Raises ImageError for one of a few pixels."""
        if min(image.shape[:2]) < LEAST_PIXELS:
            raise ImageError(
                f"a material of {image.shape[1]} x {image.shape[0]} pixels shows nothing; give a larger picture"
            )
        tile = seamless(image)
        height, width = tile.shape[:2]
        size = (width * metres_per_pixel, height * metres_per_pixel)
        if (
            metres_per_pixel * texels_per_metre < 1
        ):  # finer than a texel: its means, or texels would pick pixels at random
            columns, rows = (max(1, round(side * texels_per_metre)) for side in size)
            tile = cv2.resize(tile, (columns, rows), interpolation=cv2.INTER_AREA).reshape(rows, columns, 3)
        return cls(tile, size)

    def laid(self, across: np.ndarray, down: np.ndarray) -> np.ndarray:
        """Colour (n, 3) at places of a plane, metres to the right and down, (n,) each."""
        height, width = self.tile.shape[:2]
        x, y = across / self.size[0] * width - 0.5, down / self.size[1] * height - 0.5
        x0, y0 = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
        beside, below = (x - x0)[:, None], (y - y0)[:, None]
        left, right, top, bottom = x0 % width, (x0 + 1) % width, y0 % height, (y0 + 1) % height
        upper = self.tile[top, left] * (1 - beside) + self.tile[top, right] * beside
        lower = self.tile[bottom, left] * (1 - beside) + self.tile[bottom, right] * beside
        return upper * (1 - below) + lower * below


def seamless(image: np.ndarray) -> np.ndarray:
    """A picture (h, w, 3) as a tile that goes on into itself, (h', w', 3) float32: a quarter less of either side.

    Light that changes over the whole picture is evened out; opposite borders are joined along the path where they differ least.
    """
    flat = image.astype(np.float32)
    broad = cv2.GaussianBlur(flat, (0, 0), min(image.shape[:2]) / 4, borderType=cv2.BORDER_REFLECT)
    flat = np.clip(flat - broad + flat.mean(axis=(0, 1)), 0, 255)
    once = _joined(flat, around=False)
    return np.ascontiguousarray(_joined(once.transpose(1, 0, 2), around=True).transpose(1, 0, 2))


def _joined(image: np.ndarray, *, around: bool) -> np.ndarray:
    """The right border of (h, w, 3) laid over the left one, along the path of least difference from top to bottom; `around`
    where the rows go on into themselves, so that the path must too."""
    height, width = image.shape[:2]
    strip = max(1, int(width * JOINED))
    left, right = image[:, :strip], image[:, width - strip :]
    error = ((left - right) ** 2).sum(axis=2).astype(np.float64)
    path = least_path(np.tile(error, (3, 1)))[height : 2 * height] if around else least_path(error)
    share = np.clip((np.arange(strip)[None, :] - path[:, None]) / (2 * SOFT) + 0.5, 0, 1)[..., None].astype(np.float32)
    # the join never shows at its ends: there the one border goes on as it was, and the other begins
    share[:, 0], share[:, -1] = np.minimum(share[:, 0], 0.5 if strip == 1 else 0), 1
    return np.concatenate([right * (1 - share) + left * share, image[:, strip : width - strip]], axis=1)
