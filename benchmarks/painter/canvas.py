"""Canvas of the painter: colour, relief and gloss of a wall in metres on a supersampled raster.

The canvas has no lighting. A facade is first modelled as a coloured relief (metres in front of the wall plane), then
lit as a whole by `canvas_light.shade_canvas`, so that all its shadows agree.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array

GAMMA = 2.2  # of display values


def hex_to_linear(colour: str) -> Float32Array:
    """Convert a display colour '#rrggbb' to (3,) float32 in linear light."""
    rgb = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)], np.float32)
    return np.asarray((rgb / 255) ** np.float32(GAMMA), np.float32)


@dataclass(frozen=True)
class WallAttachment:
    """Thin object in front of the wall, such as a railing or an awning.

    Attributes
    ----------
    colour : (h, w, 3) linear light.
    alpha : (h, w) coverage in 0..1.
    y, x : raster position of its upper left corner.
    depth : metres from the wall.
    is_hinged : the plate touches the wall at its upper edge and reaches `depth` at its lower edge.
    """

    colour: Float32Array
    alpha: Float32Array
    y: int
    x: int
    depth: float
    is_hinged: bool = False


@dataclass
class Canvas:
    """Raster of a wall without lighting.

    Attributes
    ----------
    albedo : (H, W, 3) linear light.
    relief : (H, W) metres in front of the wall plane.
    gloss : (H, W) in 0..1.
    scale : raster pixels per metre.
    plates : thin objects in front of the wall.
    """

    albedo: Float32Array
    relief: Float32Array
    gloss: Float32Array
    scale: float
    plates: list[WallAttachment] = field(default_factory=list)

    @classmethod
    def blank(cls, height: int, width: int, scale: float) -> Canvas:
        """Create a black, flat, matt canvas."""
        shape = (height, width)
        return cls(np.zeros((*shape, 3), np.float32), np.zeros(shape, np.float32), np.zeros(shape, np.float32), scale)

    @property
    def height_m(self) -> float:
        """Height in metres."""
        height: float = self.relief.shape[0] / self.scale
        return height

    @property
    def width_m(self) -> float:
        """Width in metres."""
        width: float = self.relief.shape[1] / self.scale
        return width

    def to_pixels(self, metres: float) -> int:
        """Convert metres to whole raster pixels."""
        return round(metres * self.scale)

    def region(self, x0: float, y0: float, x1: float, y1: float) -> tuple[slice, slice]:
        """Return the raster slices (rows, columns) of a box in metres, at least one pixel thick, clipped to the raster."""
        rows, columns = self.relief.shape
        left, top = self.to_pixels(x0), self.to_pixels(y0)
        right, bottom = max(self.to_pixels(x1), left + 1), max(self.to_pixels(y1), top + 1)
        return slice(max(top, 0), min(max(bottom, 0), rows)), slice(max(left, 0), min(max(right, 0), columns))

    def fill_box(
        self,
        x0: float,
        y0: float,
        x1: float,
        y1: float,
        colour: Float32Array | None,
        relief: float | None = None,
        gloss: float = 0.0,
    ) -> None:
        """Fill a box.

        Parameters
        ----------
        x0, y0, x1, y1 : metres.
        colour : (3,) linear light; None keeps the material.
        relief : metres; None keeps the depth.
        gloss : in 0..1.
        """
        at = self.region(x0, y0, x1, y1)
        if colour is not None:
            self.albedo[at] = colour
            self.gloss[at] = gloss
        if relief is not None:
            self.relief[at] = relief

    def fill_polygon(
        self,
        points: Sequence[tuple[float, float]] | Float64Array,
        colour: Float32Array,
        relief: float | None = None,
        gloss: float = 0.0,
    ) -> None:
        """Fill a polygon.

        Parameters
        ----------
        points : (n, 2) x, y in metres.
        colour : (3,) linear light.
        relief : metres; None keeps the depth.
        gloss : in 0..1.
        """
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

    def add_moulding(
        self, x0: float, y0: float, x1: float, y1: float, colour: Float32Array, profile: Sequence[float]
    ) -> None:
        """Fill a box with a horizontal moulding.

        Parameters
        ----------
        x0, y0, x1, y1 : metres.
        colour : (3,) linear light.
        profile : projection in metres at equal steps from the top to the bottom.
        """
        rows, columns = self.region(x0, y0, x1, y1)
        steps = np.linspace(0, len(profile) - 1, rows.stop - rows.start)
        self.albedo[rows, columns] = colour
        self.gloss[rows, columns] = 0
        self.relief[rows, columns] = np.interp(steps, np.arange(len(profile)), profile)[:, None]

    def paste(self, tile: Canvas, x: int, y: int, where: BoolArray | None = None) -> None:
        """Copy the pixels of a tile.

        Parameters
        ----------
        tile : canvas to copy.
        x, y : raster position of its upper left corner.
        where : (h, w) bool mask of the pixels to copy; None for all.
        """
        height, width = tile.relief.shape
        at = (slice(y, y + height), slice(x, x + width))
        for target, source in ((self.albedo, tile.albedo), (self.relief, tile.relief), (self.gloss, tile.gloss)):
            if where is None:
                target[at] = source
            else:
                target[at][where] = source[where]


def smooth_noise(shape: tuple[int, int], cell: float | tuple[float, float], rng: np.random.Generator) -> Float32Array:
    """Draw smooth noise of about unit deviation.

    Parameters
    ----------
    shape : rows and columns.
    cell : raster pixels per feature, or (rows, columns) of one.
    rng : source of randomness.

    Returns
    -------
    noise : (H, W) float32.
    """
    steps = cell if isinstance(cell, tuple) else (cell, cell)
    rows, columns = (max(2, round(size / max(step, 1.0))) for size, step in zip(shape, steps, strict=True))
    grid = rng.standard_normal((rows, columns), dtype=np.float32)
    if min(shape) > 16 and min(steps) >= 12:
        # Wide features need no more than a quarter of the raster before a cheap enlargement.
        quarter = cv2.resize(grid, (shape[1] // 4, shape[0] // 4), interpolation=cv2.INTER_CUBIC)
        return np.asarray(cv2.resize(quarter, shape[::-1], interpolation=cv2.INTER_LINEAR), np.float32)
    return np.asarray(cv2.resize(grid, shape[::-1], interpolation=cv2.INTER_CUBIC), np.float32)


def fractal_noise(shape: tuple[int, int], cell: float, octaves: int, rng: np.random.Generator) -> Float32Array:
    """Draw the sum of octaves of smooth noise, each half as large and 0.6 as strong.

    Parameters
    ----------
    shape : rows and columns.
    cell : raster pixels per feature of the first octave.
    octaves : number of octaves.
    rng : source of randomness.

    Returns
    -------
    noise : (H, W) float32 of about unit deviation.
    """
    total = np.zeros(shape, np.float32)
    power = 0.0
    for octave in range(octaves):
        weight = 0.6**octave
        total += np.float32(weight) * smooth_noise(shape, cell / 2**octave, rng)
        power += weight**2
    return total / np.float32(np.sqrt(power))


def gaussian_blur(array: Float32Array, sigma: float) -> Float32Array:
    """Blur an array with a Gaussian; a wide one works on a reduced copy, at a tenth of the cost.

    Parameters
    ----------
    array : (H, W) or (H, W, C) float32.
    sigma : pixels.
    """
    factor = max(1, int(sigma / 3))
    if factor == 1 or min(array.shape[:2]) < 4 * factor:
        blurred = cv2.GaussianBlur(array, (0, 0), max(sigma, 0.3), borderType=cv2.BORDER_REPLICATE)
        return np.asarray(blurred, array.dtype)
    small = cv2.resize(array, None, fx=1 / factor, fy=1 / factor, interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(small, (0, 0), sigma / factor, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(cv2.resize(small, array.shape[1::-1], interpolation=cv2.INTER_LINEAR), array.dtype)
