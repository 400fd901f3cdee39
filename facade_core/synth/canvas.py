"""The painter's canvas: colour, relief and gloss of a wall, drawn in metres on a supersampled raster.

Nothing here knows light. A facade is first modelled as a coloured relief (metres proud of the wall plane), then lit as
a whole by `light.shade`, so that every shadow on it agrees with every other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np

GAMMA = 2.2


def hex_to_linear(colour: str) -> np.ndarray:
    """'#rrggbb' in display values -> (3,) float32 in linear light."""
    rgb = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)], np.float32)
    return (rgb / 255) ** np.float32(GAMMA)


@dataclass(frozen=True)
class Plate:
    """A thin thing that hangs in front of the wall: colour (h, w, 3) and alpha (h, w) at raster (y, x).

    depth is its distance from the wall in metres; a hinged plate starts at the wall and reaches it at its lower edge.
    """

    colour: np.ndarray
    alpha: np.ndarray
    y: int
    x: int
    depth: float
    is_hinged: bool = False


@dataclass
class Canvas:
    """albedo (H, W, 3) linear light, relief (H, W) metres, gloss (H, W) in 0..1; scale in raster pixels per metre."""

    albedo: np.ndarray
    relief: np.ndarray
    gloss: np.ndarray
    scale: float
    plates: list[Plate] = field(default_factory=list)

    @classmethod
    def blank(cls, height: int, width: int, scale: float) -> Canvas:
        shape = (height, width)
        return cls(np.zeros((*shape, 3), np.float32), np.zeros(shape, np.float32), np.zeros(shape, np.float32), scale)

    @property
    def height_m(self) -> float:
        return self.relief.shape[0] / self.scale

    @property
    def width_m(self) -> float:
        return self.relief.shape[1] / self.scale

    def px(self, metres: float) -> int:
        return round(metres * self.scale)

    def region(self, x0: float, y0: float, x1: float, y1: float) -> tuple[slice, slice]:
        """The raster pixels of a box in metres; at least one pixel thick, clipped to the raster."""
        rows, columns = self.relief.shape
        left, top = self.px(x0), self.px(y0)
        right, bottom = max(self.px(x1), left + 1), max(self.px(y1), top + 1)
        return slice(max(top, 0), min(max(bottom, 0), rows)), slice(max(left, 0), min(max(right, 0), columns))

    def box(
        self,
        x0: float,
        y0: float,
        x1: float,
        y1: float,
        colour: np.ndarray | None,
        relief: float | None = None,
        gloss: float = 0.0,
    ) -> None:
        """Fill a box; colour None keeps the material, relief None keeps the depth."""
        at = self.region(x0, y0, x1, y1)
        if colour is not None:
            self.albedo[at] = colour
            self.gloss[at] = gloss
        if relief is not None:
            self.relief[at] = relief

    def polygon(
        self,
        points: Sequence[tuple[float, float]] | np.ndarray,
        colour: np.ndarray,
        relief: float | None = None,
        gloss: float = 0.0,
    ) -> None:
        """Fill a polygon given as (x, y) in metres."""
        corners = np.asarray(points, np.float64)
        (x0, y0), (x1, y1) = corners.min(0), corners.max(0)
        at = self.region(x0, y0, x1, y1)
        mask = np.zeros(self.relief[at].shape, np.uint8)
        if not mask.size:
            return
        local = np.round(corners * self.scale - (at[1].start, at[0].start)).astype(np.int32)
        cv2.fillPoly(mask, [local], 1)
        inside = mask.astype(bool)
        self.albedo[at][inside] = colour
        self.gloss[at][inside] = gloss
        if relief is not None:
            self.relief[at][inside] = relief

    def moulding(
        self, x0: float, y0: float, x1: float, y1: float, colour: np.ndarray, profile: Sequence[float]
    ) -> None:
        """A horizontal moulding whose projection (metres) runs through `profile` from its top to its bottom."""
        rows, columns = self.region(x0, y0, x1, y1)
        steps = np.linspace(0, len(profile) - 1, rows.stop - rows.start)
        self.albedo[rows, columns] = colour
        self.gloss[rows, columns] = 0
        self.relief[rows, columns] = np.interp(steps, np.arange(len(profile)), profile)[:, None]

    def paste(self, tile: Canvas, x: int, y: int, where: np.ndarray | None = None) -> None:
        """Copy a tile's pixels to raster position (x, y); `where` (h, w) bool keeps the rest as it is."""
        height, width = tile.relief.shape
        at = (slice(y, y + height), slice(x, x + width))
        for own, new in ((self.albedo, tile.albedo), (self.relief, tile.relief), (self.gloss, tile.gloss)):
            if where is None:
                own[at] = new
            else:
                own[at][where] = new[where]


def smooth_noise(shape: tuple[int, int], cell: float | tuple[float, float], rng: np.random.Generator) -> np.ndarray:
    """Smooth noise of about unit deviation, (H, W) float32; cell = raster pixels per feature, or (rows, columns)."""
    steps = cell if isinstance(cell, tuple) else (cell, cell)
    rows, columns = (max(2, round(size / max(step, 1.0))) for size, step in zip(shape, steps, strict=True))
    grid = rng.standard_normal((rows, columns), dtype=np.float32)
    if min(shape) > 16 and min(steps) >= 12:
        # Wide features need no more than a quarter of the raster before a cheap enlargement.
        quarter = cv2.resize(grid, (shape[1] // 4, shape[0] // 4), interpolation=cv2.INTER_CUBIC)
        return cv2.resize(quarter, shape[::-1], interpolation=cv2.INTER_LINEAR)
    return cv2.resize(grid, shape[::-1], interpolation=cv2.INTER_CUBIC)


def fractal_noise(shape: tuple[int, int], cell: float, octaves: int, rng: np.random.Generator) -> np.ndarray:
    """Octaves of noise, each half as large and 0.6 as strong; about unit deviation."""
    total = np.zeros(shape, np.float32)
    power = 0.0
    for octave in range(octaves):
        weight = 0.6**octave
        total += np.float32(weight) * smooth_noise(shape, cell / 2**octave, rng)
        power += weight**2
    return total / np.float32(np.sqrt(power))


def gaussian_blur(array: np.ndarray, sigma: float) -> np.ndarray:
    """Gaussian blur; a wide one works on a reduced copy, which no eye can tell and costs a tenth."""
    factor = max(1, int(sigma / 3))
    if factor == 1 or min(array.shape[:2]) < 4 * factor:
        return cv2.GaussianBlur(array, (0, 0), max(sigma, 0.3), borderType=cv2.BORDER_REPLICATE)
    small = cv2.resize(array, None, fx=1 / factor, fy=1 / factor, interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(small, (0, 0), sigma / factor, borderType=cv2.BORDER_REPLICATE)
    return cv2.resize(small, array.shape[1::-1], interpolation=cv2.INTER_LINEAR)
