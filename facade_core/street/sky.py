"""The sky of pictures: a gradient from the horizon up, and the haze that lies before what is far."""

from __future__ import annotations

import numpy as np

# Colours at the horizon, straight up, and of land far below it; beyond HAZE_M metres two thirds of a colour are the horizon's.
HORIZON, ZENITH = np.array([222.0, 231.0, 238.0]), np.array([104.0, 151.0, 205.0])
LAND = np.array([178.0, 184.0, 182.0])
HAZE_M = 1500.0


def sky(up: np.ndarray) -> np.ndarray:
    """The sky's colour (..., 3) float, 0..255, in directions that rise by `up` (...,), the sine of their height; below the
    horizon that of land in the haze, on which the block stands."""
    share = np.clip(up, 0.0, 1.0)[..., None] ** 0.55
    below = np.clip(-2.5 * up, 0.0, 1.0)[..., None]
    return HORIZON + (ZENITH - HORIZON) * share + (LAND - HORIZON) * below


def under_sky(rgb: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """An equirectangular panorama (h, w, 3) uint8 with the sky where its depth (h, w) is infinite."""
    height = len(rgb)
    up = np.sin(np.pi * (0.5 - (np.arange(height) + 0.5) / height))
    shown = np.broadcast_to(sky(up).astype(np.uint8)[:, None], rgb.shape)
    return np.where(np.isinf(depth)[..., None], shown, rgb)
