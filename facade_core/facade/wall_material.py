"""What a building's walls are of, by its own facade: the colour of the wall there, and whether it is laid of bricks."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from facade_core.core.labels import FacadeClass

# Of wall that must be seen, square metres; its brightness between these shares counts: neither shadow nor what shines.
MIN_WALL_M2, LIT_QUANTILES = 3.0, (0.45, 0.95)
# Courses to the metre of bricks, and with those around them; pieces of wall that are looked at, metres wide and high, and how
# many; a peak so many times what is around it. Below so many texels a metre courses cannot be told.
COURSES_PER_METRE, BAND_PER_METRE = (11.6, 14.4), (7.0, 16.0)
PATCH_SIZE_M, MIN_PATCHES = (0.8, 1.6), 4
MIN_PEAK_RATIO, MIN_TEXELS_PER_METRE = 8.0, 30.0


class WallMaterial(NamedTuple):
    """colour (3,): 0..255; brick: whether courses of bricks show, else it is taken for plaster of that colour."""

    colour: np.ndarray
    brick: bool


def measure_wall_material(image: np.ndarray, labels: np.ndarray, texels_per_metre: float) -> WallMaterial | None:
    """The wall of a facade (h, w, 3) uint8 with labels (h, w); None where too little of it shows."""
    on = labels == FacadeClass.WALL
    if on.sum() < MIN_WALL_M2 * texels_per_metre**2:
        return None
    return WallMaterial(lit_colour(image[on]), _shows_courses(image, on, texels_per_metre))


def lit_colour(pixels: np.ndarray) -> np.ndarray:
    """The colour (3,) of wall's texels (n, 3) that lie neither in shadow nor shine."""
    light = pixels.mean(axis=1, dtype=np.float64)
    low, high = np.quantile(light, LIT_QUANTILES)
    lit = (light >= low) & (light <= high)
    return np.asarray(np.median(pixels[lit if lit.any() else slice(None)].astype(np.float64), axis=0))


def _shows_courses(image: np.ndarray, on: np.ndarray, density: float) -> bool:
    """Whether whole pieces of wall have the period of courses down them."""
    if density < MIN_TEXELS_PER_METRE:
        return False
    wide, high = (round(side * density) for side in PATCH_SIZE_M)
    light = image.astype(np.float64).mean(axis=2)
    window, power = np.hanning(high), []
    for top in range(0, on.shape[0] - high + 1, high // 2):
        for left in range(0, on.shape[1] - wide + 1, wide):
            if on[top : top + high, left : left + wide].all():
                profile = light[top : top + high, left : left + wide].mean(axis=1)
                power.append(np.abs(np.fft.rfft((profile - profile.mean()) * window)) ** 2)
    if len(power) < MIN_PATCHES:
        return False
    spectrum, frequency = np.median(power, axis=0), np.fft.rfftfreq(high, 1 / density)
    courses = (frequency >= COURSES_PER_METRE[0]) & (frequency <= COURSES_PER_METRE[1])
    around = (frequency >= BAND_PER_METRE[0]) & (frequency <= BAND_PER_METRE[1]) & ~courses
    return bool(spectrum[courses].max() > MIN_PEAK_RATIO * np.median(spectrum[around]) + 1e-9)
