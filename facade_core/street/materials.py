"""Procedural materials as functions of the world point: the same wherever they are seen from."""

from __future__ import annotations

import numpy as np
from numba import njit

# Muted Nordic plasters and roofs, sRGB 0..255.
PLASTERS = np.array(
    [
        [214, 196, 160],
        [206, 178, 140],
        [196, 170, 152],
        [188, 192, 176],
        [204, 200, 190],
        [182, 160, 138],
        [216, 206, 182],
    ],
    np.float64,
)
ROOFS = np.array([[92, 74, 66], [104, 106, 108], [72, 78, 80], [122, 82, 66], [86, 96, 88]], np.float64)
TILES = np.array([[158, 86, 62], [142, 74, 56], [170, 104, 76], [112, 72, 62], [88, 84, 84]], np.float64)
WOODS = np.array([[96, 66, 44], [72, 50, 38], [58, 74, 66], [84, 46, 40], [112, 86, 60]], np.float64)
GLASS = np.array([44.0, 52.0, 60.0])
SKY = np.array([176.0, 198.0, 220.0])
# Width and visible length of a roof tile, metres.
TILE_M = (0.24, 0.34)

_LOW32 = np.uint64(0xFFFFFFFF)


@njit(cache=True)
def _hash(x: int, y: int, seed: int) -> float:
    # numba widens uint32 products to 64 bits, so the wrap to 32 is explicit
    h = (np.uint64(x) & _LOW32) * np.uint64(0x8DA6B343) ^ (np.uint64(y) & _LOW32) * np.uint64(0xD8163841)
    h = (h ^ np.uint64(seed) * np.uint64(0xCB1AB31F)) & _LOW32
    h = ((h ^ (h >> np.uint64(15))) * np.uint64(0x2C1B3C6D)) & _LOW32
    h = ((h ^ (h >> np.uint64(12))) * np.uint64(0x297A2D39)) & _LOW32
    return np.float64(h ^ (h >> np.uint64(15))) / 4294967296.0


@njit(cache=True)
def value_noise(x: np.ndarray, y: np.ndarray, seed: int) -> np.ndarray:
    """Smooth lattice noise in 0..1 at points x, y (n,), one cell per unit."""
    out = np.empty(len(x))
    for i in range(len(x)):
        x0, y0 = np.floor(x[i]), np.floor(y[i])
        fx, fy = x[i] - x0, y[i] - y0
        fx, fy = fx * fx * (3 - 2 * fx), fy * fy * (3 - 2 * fy)
        ix, iy = int(x0), int(y0)
        a, b = _hash(ix, iy, seed), _hash(ix + 1, iy, seed)
        c, d = _hash(ix, iy + 1, seed), _hash(ix + 1, iy + 1, seed)
        out[i] = a + (b - a) * fx + (c - a) * fy + (a - b - c + d) * fx * fy
    return out


def _mottle(x: np.ndarray, y: np.ndarray, seed: int, scales: tuple[float, ...]) -> np.ndarray:
    """Noise of several scales (metres) around 0, (n,), in about -1..1."""
    total = sum((value_noise(x / s, y / s, seed + k) - 0.5 for k, s in enumerate(scales)), np.zeros(len(x)))
    return 2 * total / len(scales)


def asphalt(points: np.ndarray, aside: np.ndarray, seed: int) -> np.ndarray:
    """Carriageway: worn asphalt, lighter in the wheel tracks. points (n, 3), aside (n,) metres from the centreline."""
    noise = _mottle(points[:, 0], points[:, 1], seed, (0.15, 0.6, 4.0))
    tracks = 5 * np.exp(-(((aside - 1.7) / 0.5) ** 2))
    return (98 + 13 * noise + tracks)[:, None] * np.array([1.0, 1.0, 1.02])


def paving(points: np.ndarray, seed: int) -> np.ndarray:
    """Pavement of slabs, 0.6 x 0.4 m in running bond, with darker joints. points (n, 3)."""
    row = np.floor(points[:, 1] / 0.4)
    x = points[:, 0] / 0.6 + 0.5 * (row % 2)
    joint = (np.abs(x - np.round(x)) * 0.6 < 0.02) | (
        np.abs(points[:, 1] / 0.4 - np.round(points[:, 1] / 0.4)) * 0.4 < 0.02
    )
    slab = value_noise(np.floor(x), row, seed + 11)
    noise = _mottle(points[:, 0], points[:, 1], seed + 3, (0.2, 1.5, 6.0))
    return ((148 + 14 * (slab - 0.5) + 10 * noise) * np.where(joint, 0.86, 1.0))[:, None] * np.array(
        [1.0, 0.985, 0.955]
    )


def roofing(points: np.ndarray, building: np.ndarray, seed: int) -> np.ndarray:
    """Sheet-metal roof with standing seams every 0.6 m, one colour per building. points (n, 3), building (n,)."""
    tint = _pick(ROOFS, building, seed + 5)
    seam = np.abs(points[:, 0] / 0.6 - np.round(points[:, 0] / 0.6)) * 0.6 < 0.04
    noise = _mottle(points[:, 0], points[:, 1], seed + 7, (0.8, 5.0))
    return tint * (1 + 0.10 * noise - 0.12 * seam)[:, None]


def tiling(across: np.ndarray, down: np.ndarray, building: np.ndarray, seed: int) -> np.ndarray:
    """Tilted roof of clay tiles in rows that overlap down the slope, one colour per building; all arguments (n,), metres."""
    tint = _pick(TILES, building, seed + 19)
    row = np.floor(down / TILE_M[1])
    column = across / TILE_M[0] + 0.5 * (row % 2)
    share = down / TILE_M[1] - row
    tile = value_noise(np.floor(column), row, seed + 23) - 0.5
    crest = np.cos(2 * np.pi * (column - np.floor(column) - 0.5))
    noise = _mottle(across, down, seed + 29, (0.8, 5.0))
    return tint * (1 + 0.08 * noise + 0.10 * tile + 0.05 * crest - 0.22 * (share > 0.86))[:, None]


def plaster(along: np.ndarray, down: np.ndarray, above: np.ndarray, building: np.ndarray, seed: int) -> np.ndarray:
    """Bare rendered wall, dirtier near the ground, one colour per building; all arguments (n,), metres."""
    tint = _pick(PLASTERS, building, seed + 9)
    noise = _mottle(along, down, seed + 13, (0.25, 1.2, 5.0))
    streaks = value_noise(along / 0.35, down / 6.0, seed + 17) - 0.5
    dirt = 0.16 * np.exp(-np.maximum(above, 0) / 0.7)
    return tint * (1 + 0.06 * noise + 0.05 * streaks - dirt)[:, None]


def glass(along: np.ndarray, down: np.ndarray, height: np.ndarray, seed: int) -> np.ndarray:
    """Window pane: dark, with more sky in it towards its top; along, down and the pane's height (n,), metres."""
    sky = np.clip(1 - down / np.maximum(height, 0.1), 0, 1)
    noise = _mottle(along, down, seed + 31, (0.7, 2.5))
    return GLASS + (sky**2 * (1 + 0.3 * noise) + 0.08 * noise)[:, None] * (SKY - GLASS) * 0.55


def wood(along: np.ndarray, down: np.ndarray, building: np.ndarray, seed: int) -> np.ndarray:
    """Door of upright boards 0.12 m wide, one colour per building; all arguments (n,), metres."""
    tint = _pick(WOODS, building, seed + 37)
    board = along / 0.12
    joint = np.abs(board - np.round(board)) < 0.06
    grain = value_noise(along / 0.02, down / 0.6, seed + 41) - 0.5
    plank = value_noise(np.floor(board + 0.5), np.zeros(len(board)), seed + 43) - 0.5
    return tint * (1 + 0.16 * grain + 0.10 * plank - 0.35 * joint)[:, None]


def soffit(across: np.ndarray, down: np.ndarray, seed: int) -> np.ndarray:
    """Grey plaster of what is seen from below; across and down (n,), metres."""
    noise = _mottle(across, down, seed + 47, (0.3, 1.5, 5.0))
    return (172 * (1 + 0.05 * noise))[:, None] * np.array([1.0, 0.99, 0.97])


def _pick(palette: np.ndarray, building: np.ndarray, seed: int) -> np.ndarray:
    index = value_noise(building.astype(np.float64), np.full(len(building), 0.0), seed) * len(palette)
    return palette[np.minimum(index.astype(np.int64), len(palette) - 1)]
