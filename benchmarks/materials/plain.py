"""Materials as plain functions of a point, in numpy: what kernels integrate over footprints, and what steps without.

All take x, y (n,) and `other` (n,), what the material depends on besides (metres from the centreline, above the foot of the
wall, or the height of the pane), and return tones (n,).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from facade_core.street.lighting.settings import TONE_CURVE

_ACROSS, _DOWN = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xC2B2AE3D27D4EB4F)
_SEED, _MIX = np.uint64(0x165667B19E3779F9), np.uint64(0xD6E8FEB86659FD93)


def _chance(column: np.ndarray, row: np.ndarray, seed: int) -> np.ndarray:
    with np.errstate(over="ignore"):
        below = (row.astype(np.int64).view(np.uint64) + np.uint64(seed) * _SEED) * _DOWN
        h = column.astype(np.int64).view(np.uint64) * _ACROSS + below
        h = (h ^ (h >> np.uint64(32))) * _MIX
    return (h >> np.uint64(40)).astype(np.float64) / 2**24


def noise(x: np.ndarray, y: np.ndarray, seed: int) -> np.ndarray:
    """Smooth lattice noise around 0, -1..1, one cell a unit."""
    x0, y0 = np.floor(x), np.floor(y)
    u, v = ((3 - 2 * t) * t * t for t in (x - x0, y - y0))
    upper = _chance(x0, y0, seed) * (1 - u) + _chance(x0 + 1, y0, seed) * u
    lower = _chance(x0, y0 + 1, seed) * (1 - u) + _chance(x0 + 1, y0 + 1, seed) * u
    return 2 * (upper * (1 - v) + lower * v) - 1


def _mottle(x: np.ndarray, y: np.ndarray, seed: int, scales: tuple[float, ...]) -> np.ndarray:
    """Noise of several scales, -1..1."""
    return np.mean([noise(x / scale, y / scale, seed + k) for k, scale in enumerate(scales)], axis=0)


def asphalt(x: np.ndarray, y: np.ndarray, other: np.ndarray, seed: int) -> np.ndarray:
    tracks = np.maximum(1 - ((other - 1.7) / 0.5) ** 2 / 8, 0) ** 8
    return 98 + 13 * _mottle(x, y, seed, (0.15, 0.6, 4.0)) + 5 * tracks


def paving(x: np.ndarray, y: np.ndarray, other: np.ndarray, seed: int) -> np.ndarray:
    row = np.floor(y / 0.4)
    column = x / 0.6 + 0.5 * (row % 2)
    joint = np.abs(column - np.round(column)) * 0.6 < 0.02
    joint |= np.abs(y / 0.4 - np.round(y / 0.4)) * 0.4 < 0.02
    slab = _chance(np.floor(column), row, seed + 11) - 0.5
    return (148 + 14 * slab + 10 * _mottle(x, y, seed + 3, (0.2, 1.5, 6.0))) * np.where(joint, 0.86, 1.0)


def roofing(x: np.ndarray, y: np.ndarray, other: np.ndarray, seed: int) -> np.ndarray:
    seam = np.abs(x / 0.6 - np.round(x / 0.6)) * 0.6 < 0.04
    return 1 + 0.10 * _mottle(x, y, seed + 7, (0.8, 5.0)) - 0.12 * seam


def tiling(x: np.ndarray, y: np.ndarray, other: np.ndarray, seed: int) -> np.ndarray:
    row = np.floor(y / 0.34)
    column = x / 0.24 + 0.5 * (row % 2)
    tile = _chance(np.floor(column), row, seed + 23) - 0.5
    away = 2 * np.abs(column - np.floor(column) - 0.5)
    crest = 1 - 2 * (3 - 2 * away) * away**2
    shadow = y / 0.34 - row > 0.86
    return 1 + 0.08 * _mottle(x, y, seed + 29, (0.8, 5.0)) + 0.10 * tile + 0.05 * crest - 0.22 * shadow


def plaster(x: np.ndarray, y: np.ndarray, other: np.ndarray, seed: int) -> np.ndarray:
    dirt = np.maximum(1 - np.maximum(other, 0) / 11.2, 0) ** 16
    streaks = 0.025 * noise(x / 0.3, y / 1.1, seed + 17)
    return 1 + 0.06 * _mottle(x, y, seed + 13, (0.25, 1.2, 5.0)) + streaks - 0.16 * dirt


def glass(x: np.ndarray, y: np.ndarray, other: np.ndarray, seed: int) -> np.ndarray:
    sky = np.clip(1 - y / other, 0, 1)
    stain = _mottle(x, y, seed + 31, (0.7, 2.5))
    return 0.55 * (sky**2 * (1 + 0.3 * stain) + 0.08 * stain)


def wood(x: np.ndarray, y: np.ndarray, other: np.ndarray, seed: int) -> np.ndarray:
    board = x / 0.12
    plank = _chance(np.floor(board), np.zeros(len(x)), seed + 43) - 0.5
    joint = np.abs(board - np.round(board)) < 0.06
    return 1 + 0.08 * noise(x / 0.02, y / 0.6, seed + 41) + 0.24 * plank - 0.35 * joint


def soffit(x: np.ndarray, y: np.ndarray, other: np.ndarray, seed: int) -> np.ndarray:
    return 1 + 0.05 * _mottle(x, y, seed + 47, (0.3, 1.5, 5.0))


MATERIALS: dict[str, Callable[[np.ndarray, np.ndarray, np.ndarray, int], np.ndarray]] = {
    function.__name__: function for function in (asphalt, paving, roofing, tiling, plaster, glass, wood, soffit)
}


def camera_tones(exposure: np.ndarray) -> np.ndarray:
    """Return the colours (..., 3) of exposures (..., 3) in 0..255 and above by the camera's curve."""
    pivot, contrast, share = TONE_CURVE.pivot, TONE_CURVE.contrast, exposure / 255
    grey = (share @ np.array([0.299, 0.587, 0.114]))[..., None]
    shoulder = 1 - np.exp(-contrast * (grey - pivot) / (1 - pivot))
    tone = np.where(grey < pivot, pivot * (grey / pivot) ** contrast, pivot + (1 - pivot) * shoulder)
    return np.clip(255 * tone * (1 + TONE_CURVE.saturation * (share / np.maximum(grey, 1e-9) - 1)), 0, 255)
