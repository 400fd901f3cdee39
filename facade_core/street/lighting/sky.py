"""The sky of pictures: a gradient from the horizon up, and the haze that lies before what is far."""

from __future__ import annotations

import numpy as np

# Colours at the horizon, straight up, and of land far below it; beyond HAZE_M metres two thirds of a colour are the horizon's.
HORIZON_COLOUR, ZENITH_COLOUR = np.array([222.0, 231.0, 238.0]), np.array([104.0, 151.0, 205.0])
LAND_COLOUR = np.array([178.0, 184.0, 182.0])
HAZE_M = 1500.0
# Rows of roofs around the horizon, the farther first: how many houses, the least rise of their roofs and how much more the
# highest have (tangents), and the share of haze. Colours of their walls and roofs without it. An edge is so soft; walls
# stand so far below the horizon, where the ground of the block ends.
ROOFLINES = ((151, 0.050, 0.035, 0.66), (89, 0.026, 0.040, 0.42))
HOUSE_COLOUR, ROOF_COLOUR = np.array([148.0, 143.0, 134.0]), np.array([122.0, 98.0, 88.0])
ROOFLINE_BLUR, MAX_WALL_DROP = 0.0025, 0.014


def sky_colour(up: np.ndarray) -> np.ndarray:
    """The sky's colour (..., 3) float, 0..255, in directions that rise by `up` (...,), the sine of their height; below the
    horizon that of land in the haze, on which the block stands."""
    share = np.clip(up, 0.0, 1.0)[..., None] ** 0.55
    below = np.clip(-80 * up, 0.0, 1.0)[..., None]
    return HORIZON_COLOUR + (ZENITH_COLOUR - HORIZON_COLOUR) * share + (LAND_COLOUR - HORIZON_COLOUR) * below


def backdrop_colour(rays: np.ndarray) -> np.ndarray:
    """What pictures show behind the block, (..., 3) float, 0..255, in unit directions (..., 3): the sky, and in the haze before
    its horizon two rows of roofs, so that no street ends in nothing. They are of no map: chance by the direction alone."""
    shown = sky_colour(rays[..., 2])
    steep = rays[..., 2] / np.maximum(np.hypot(rays[..., 0], rays[..., 1]), 1e-6)
    low = (steep < max(lowest + higher for _, lowest, higher, _ in ROOFLINES)) & (steep > -MAX_WALL_DROP - ROOFLINE_BLUR)
    shown[low] = _add_rooflines(shown[low], rays[low], steep[low])
    return shown


def _add_rooflines(colour: np.ndarray, rays: np.ndarray, steep: np.ndarray) -> np.ndarray:
    """Colours (k, 3) in directions (k, 3) of such a rise (k,), with the rows of roofs before them."""
    around = (np.arctan2(rays[:, 0], rays[:, 1]) / (2 * np.pi)) % 1.0
    for row, (houses, lowest, higher, haze) in enumerate(ROOFLINES):
        at = around * houses
        house = np.minimum(at, houses - 1).astype(np.uint32)
        height = lowest + higher * _hash_numbers(house, 3 * row)
        # some roofs slope to their neighbours
        height *= 1 - np.where(_hash_numbers(house, 3 * row + 1) < 0.5, 0.4 * np.abs(at - house - 0.5), 0.0)
        tone = HOUSE_COLOUR * (0.9 + 0.2 * _hash_numbers(house, 3 * row + 2))[:, None]
        tone[steep > 0.8 * height] = ROOF_COLOUR
        covers = np.clip((height - steep) / ROOFLINE_BLUR, 0.0, 1.0) * np.clip(1 + (steep + MAX_WALL_DROP) / ROOFLINE_BLUR, 0.0, 1.0)
        colour = colour + covers[:, None] * (tone + haze * (HORIZON_COLOUR - tone) - colour)
    return colour


def _hash_numbers(number: np.ndarray, turn: int) -> np.ndarray:
    """Chance (...,) float in 0..1 of numbers (...,) uint32; the page's shader draws the same."""
    bits = (number + np.uint32(97 * turn + 1)) * np.uint32(2654435769)
    bits = (bits ^ (bits >> np.uint32(15))) * np.uint32(2246822519)
    bits = bits ^ (bits >> np.uint32(13))
    return bits / 2.0**32


def add_sky(rgb: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """An equirectangular panorama (h, w, 3) uint8 with the sky where its depth (h, w) is infinite."""
    height = len(rgb)
    up = np.sin(np.pi * (0.5 - (np.arange(height) + 0.5) / height))
    shown = np.broadcast_to(sky_colour(up).astype(np.uint8)[:, None], rgb.shape)
    return np.where(np.isinf(depth)[..., None], shown, rgb)
