"""Sky of pictures: a gradient from the horizon up, and haze in front of distant surfaces."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import AnyArray, Float32Array, Float64Array, UInt8Array
from facade_core.street.lighting.settings import SKY_LOOK

HORIZON_COLOUR = np.array([222.0, 231.0, 238.0])
ZENITH_COLOUR = np.array([104.0, 151.0, 205.0])
# Land far below the horizon.
LAND_COLOUR = np.array([178.0, 184.0, 182.0])
HOUSE_COLOUR = np.array([148.0, 143.0, 134.0])
ROOF_COLOUR = np.array([122.0, 98.0, 88.0])


def sky_colour(up: Float64Array) -> Float64Array:
    """Compute the sky's colour; below the horizon it is land in haze.

    Parameters
    ----------
    up : (...,) sine of the elevation.

    Returns
    -------
    (..., 3) in 0..255.
    """
    share = np.clip(up, 0.0, 1.0)[..., None] ** 0.55
    below = np.clip(-80 * up, 0.0, 1.0)[..., None]
    colour: Float64Array = (
        HORIZON_COLOUR + (ZENITH_COLOUR - HORIZON_COLOUR) * share + (LAND_COLOUR - HORIZON_COLOUR) * below
    )
    return colour


def backdrop_colour(rays: Float64Array) -> Float64Array:
    """Compute the colour behind the block.

    Two rows of roofs in the haze close the horizon. They are not from a map but hashed from the direction.

    Parameters
    ----------
    rays : (..., 3) unit directions.

    Returns
    -------
    (..., 3) in 0..255.
    """
    colour = sky_colour(rays[..., 2])
    slope = rays[..., 2] / np.maximum(np.hypot(rays[..., 0], rays[..., 1]), 1e-6)
    below_roofs = (slope < max(lowest + higher for _, lowest, higher, _ in SKY_LOOK.rooflines)) & (
        slope > -SKY_LOOK.max_wall_drop - SKY_LOOK.roofline_blur
    )
    colour[below_roofs] = _add_rooflines(colour[below_roofs], rays[below_roofs], slope[below_roofs])
    return colour


def _add_rooflines(colour: Float64Array, rays: Float64Array, slope: Float64Array) -> Float64Array:
    """Add rows of roofs to colours (k, 3) in directions (k, 3) with slopes (k,)."""
    around = (np.arctan2(rays[:, 0], rays[:, 1]) / (2 * np.pi)) % 1.0
    for row, (houses, lowest, higher, haze) in enumerate(SKY_LOOK.rooflines):
        position = around * houses
        house = np.minimum(position, houses - 1).astype(np.uint32)
        height = lowest + higher * _hash_numbers(house, 3 * row)
        # some roofs slope to their neighbours
        height *= 1 - np.where(_hash_numbers(house, 3 * row + 1) < 0.5, 0.4 * np.abs(position - house - 0.5), 0.0)
        tone = HOUSE_COLOUR * (0.9 + 0.2 * _hash_numbers(house, 3 * row + 2))[:, None]
        tone[slope > 0.8 * height] = ROOF_COLOUR
        covers = np.clip((height - slope) / SKY_LOOK.roofline_blur, 0.0, 1.0) * np.clip(
            1 + (slope + SKY_LOOK.max_wall_drop) / SKY_LOOK.roofline_blur, 0.0, 1.0
        )
        colour = colour + covers[:, None] * (tone + haze * (HORIZON_COLOUR - tone) - colour)
    return colour


def _hash_numbers(number: AnyArray, turn: int) -> Float64Array:
    """Hash numbers (...,) uint32 to 0..1; the shader of the web page computes the same values."""
    bits = (number + np.uint32(97 * turn + 1)) * np.uint32(2654435769)
    bits = (bits ^ (bits >> np.uint32(15))) * np.uint32(2246822519)
    bits = bits ^ (bits >> np.uint32(13))
    return bits / 2.0**32


def add_sky(rgb: UInt8Array, depth: Float32Array) -> UInt8Array:
    """Replace the pixels of infinite depth by the sky.

    Parameters
    ----------
    rgb : (h, w, 3) uint8 equirectangular panorama.
    depth : (h, w) metres.

    Returns
    -------
    (h, w, 3) uint8.
    """
    height = len(rgb)
    up = np.sin(np.pi * (0.5 - (np.arange(height) + 0.5) / height))
    sky = np.broadcast_to(sky_colour(up).astype(np.uint8)[:, None], rgb.shape)
    return np.where(np.isinf(depth)[..., None], sky, rgb)
