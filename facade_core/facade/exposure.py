"""Common exposure of the pictured walls of one building."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.core.arrays import Float64Array, UInt8Array

# Largest slope of the tone curve at black.
MAX_SLOPE = 2.0
# Walls whose slope would be smaller are as light as the lightest one.
MIN_SLOPE = 1.05
# Largest difference of log(blue / green) between walls of one material: shade is bluer than sun,
MAX_BLUE_DIFFERENCE = 0.2
# and its log(red / green) is lower by half of that, as daylight of another temperature is; up to this difference.
MAX_RED_DIFFERENCE = 0.13
# Largest deviation of a channel's slope from their mean.
MAX_CHANNEL_DEVIATION = 0.1
# A wall in the shade of its picture may be darker than the lightest wall of its material by this factor.
MAX_SHADE_RATIO = 1.5
# Colours are kept this far from black and white, 0..255.
COLOUR_MARGIN = 4.0


def level_wall_colours(colours: Sequence[Float64Array], exposures: Sequence[str]) -> Float64Array:
    """Return the tone curves that bring the pictures of a building's walls to one exposure.

    A house is photographed from several sides, by pictures of several exposures. Where walls of two exposures have one hue,
    the darker ones are lightened, within bounds. What differs between walls of one exposure is sun and shade: it stays, up to
    MAX_SHADE_RATIO.

    Parameters
    ----------
    colours : (3,) lit colour of each wall, 0..255.
    exposures : name of the exposure that each wall has: of a picture, or of all that have a common one.

    Returns
    -------
    (n, 3) slope at black of each wall and channel, for `apply_tone_curve`; 1 leaves it as it is.
    """
    values = np.clip(np.array(colours, np.float64).reshape(-1, 3), COLOUR_MARGIN, 255 - COLOUR_MARGIN) / 255
    logs = np.log(values)
    hue = logs[:, [0, 2]] - logs[:, [1]]
    light = values.mean(axis=1)
    slopes = np.ones_like(values)
    for own in range(len(values)):
        red, blue = (hue - hue[own]).T
        alike = np.flatnonzero((np.abs(red + blue / 2) <= MAX_RED_DIFFERENCE) & (np.abs(blue) <= MAX_BLUE_DIFFERENCE))
        beside = np.array([wall for wall in alike.tolist() if exposures[wall] == exposures[own]])
        lightest, lead = (group[light[group].argmax()] for group in (alike, beside))
        exposed = _lighten_colour(values[own], _tone_slope(values[lead], values[lightest]))
        darkest = values[lightest] / MAX_SHADE_RATIO
        slope = _tone_slope(values[own], exposed if exposed.mean() >= darkest.mean() else darkest)
        mean = min(float(slope.mean()), MAX_SLOPE)
        if mean >= MIN_SLOPE:
            limits = mean * (1 - MAX_CHANNEL_DEVIATION), mean * (1 + MAX_CHANNEL_DEVIATION)
            slopes[own] = np.clip(slope * (mean / slope.mean()), *limits)
    return slopes


def _tone_slope(dark: Float64Array, light: Float64Array) -> Float64Array:
    """Return the slope (3,) of the curve that takes one colour (3,), 0 to 1, to another."""
    return np.asarray(np.log(1 - light) / np.log(1 - dark), np.float64)


def _lighten_colour(colour: Float64Array, slope: Float64Array) -> Float64Array:
    return np.asarray(1 - (1 - colour) ** slope, np.float64)


def apply_tone_curve(image: UInt8Array, slope: Float64Array) -> UInt8Array:
    """Lighten a picture (h, w, 3): by its slope near black, ever less towards white, which stays.

    Parameters
    ----------
    slope : (3,) slope at black, 1 or more.
    """
    tones = np.arange(256)[:, None] / 255
    table = np.rint(255 * _lighten_colour(tones, slope)).astype(np.uint8)
    return np.stack([table[image[..., band], band] for band in range(3)], axis=-1)
