"""Wall material of a building from its own facade: colour, and bricks or plaster."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, UInt8Array
from facade_core.core.labels import FacadeClass

# Smallest area of visible wall, square metres.
MIN_WALL_M2 = 3.0
# Brightness quantiles between which wall is neither in shadow nor glossy.
LIT_QUANTILES = (0.45, 0.95)
# Courses of bricks for each metre.
COURSES_PER_METRE = (11.6, 14.4)
# Frequencies for each metre that a peak of courses is compared with.
BAND_PER_METRE = (7.0, 16.0)
# Width and height of an analysed patch of wall, metres.
PATCH_SIZE_M = (0.8, 1.6)
# Smallest number of patches.
MIN_PATCHES = 4
# Smallest ratio of the peak of courses to the median of its band.
MIN_PEAK_RATIO = 8.0
# Texels for each metre from which courses are visible.
MIN_TEXELS_PER_METRE = 30.0
# Weight of the mean colour of a wall where none is near.
MEAN_WEIGHT = 1e-3


class WallMaterial(NamedTuple):
    """Colour and structure of a wall.

    Attributes
    ----------
    colour : (3,) 0..255.
    brick : True if courses of bricks show; otherwise plaster of that colour.
    """

    colour: Float64Array
    brick: bool


def measure_wall_material(image: UInt8Array, labels: UInt8Array, texels_per_metre: float) -> WallMaterial | None:
    """Measure the wall material of a facade, None where too little wall is visible.

    Parameters
    ----------
    image : (h, w, 3) uint8.
    labels : (h, w) uint8 class ids.
    texels_per_metre : resolution of the image.
    """
    is_wall = labels == FacadeClass.WALL
    if is_wall.sum() < MIN_WALL_M2 * texels_per_metre**2:
        return None
    return WallMaterial(lit_colour(image[is_wall]), _shows_courses(image, is_wall, texels_per_metre))


def lit_colour(pixels: UInt8Array) -> Float64Array:
    """Return the (3,) colour of wall texels (n, 3) that are neither in shadow nor glossy."""
    light = pixels.mean(axis=1, dtype=np.float64)
    low, high = np.quantile(light, LIT_QUANTILES)
    lit = (light >= low) & (light <= high)
    return np.asarray(np.median(pixels[lit if lit.any() else slice(None)].astype(np.float64), axis=0))


def wall_colour_field(image: Float32Array, wall: Float32Array, sigma: float) -> Float32Array:
    """Return the colour (h, w, 3) of the wall near every pixel, also where an element stands before it.

    Parameters
    ----------
    image : (h, w, 3) float32.
    wall : (h, w) float32 share of wall of each pixel.
    sigma : deviation of the mean, pixels.
    """
    weight = wall[..., None] + np.float32(MEAN_WEIGHT)
    mean = (image * weight).sum(axis=(0, 1), dtype=np.float64) / weight.sum(dtype=np.float64)
    near, share = (
        cv2.GaussianBlur(one, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE) for one in (image * wall[..., None], wall)
    )
    field: Float32Array = (near + (MEAN_WEIGHT * mean).astype(np.float32)) / (share + np.float32(MEAN_WEIGHT))[
        ..., None
    ]
    return field


def paint_plaster(shape: tuple[int, int], colour: Float64Array, grain: float) -> UInt8Array:
    """Return (h, w, 3) plaster of a colour (3,), whose light deviates by a grain, grey levels."""
    light = grain * np.random.default_rng(0).standard_normal((*shape, 1))
    plaster: UInt8Array = np.clip(np.rint(colour + light), 0, 255).astype(np.uint8)
    return plaster


def _shows_courses(image: UInt8Array, is_wall: BoolArray, density: float) -> bool:
    """Return whether the vertical profile of wall patches has the period of brick courses."""
    if density < MIN_TEXELS_PER_METRE:
        return False
    wide, high = (round(side * density) for side in PATCH_SIZE_M)
    light = image.astype(np.float64).mean(axis=2)
    window, power = np.hanning(high), []
    for top in range(0, is_wall.shape[0] - high + 1, high // 2):
        for left in range(0, is_wall.shape[1] - wide + 1, wide):
            if is_wall[top : top + high, left : left + wide].all():
                profile = light[top : top + high, left : left + wide].mean(axis=1)
                power.append(np.abs(np.fft.rfft((profile - profile.mean()) * window)) ** 2)
    if len(power) < MIN_PATCHES:
        return False
    spectrum, frequency = np.median(power, axis=0), np.fft.rfftfreq(high, 1 / density)
    courses = (frequency >= COURSES_PER_METRE[0]) & (frequency <= COURSES_PER_METRE[1])
    around = (frequency >= BAND_PER_METRE[0]) & (frequency <= BAND_PER_METRE[1]) & ~courses
    return bool(spectrum[courses].max() > MIN_PEAK_RATIO * np.median(spectrum[around]) + 1e-9)
