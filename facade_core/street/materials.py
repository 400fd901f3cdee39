"""Procedural materials, a kernel each: tones of places, each meant over its footprint, so that nothing aliases.

Joints, seams and edges count by the share of the footprint that they cover, the integral of their box over it. Lattice noise
and the tones of slabs, tiles and boards are integrated over it too, and fade where it covers several of them. All arrays are
(n,), without a branch within their loops, so that several places are worked out at once; lengths are metres; a footprint is
the side of a square, longer than 0.
"""

from __future__ import annotations

import numpy as np

from facade_core.kernels import njit
from facade_core.street import grain
from facade_core.street.chance import ACROSS, DOWN, SEED, mixed, row_of
from facade_core.types import SURFACES

# Muted Nordic plasters and roofs.
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
SLATES = np.array([[84, 88, 94], [74, 78, 82], [92, 92, 98], [70, 76, 74]], np.float64)
FELTS = np.array([[82, 80, 78], [98, 95, 91], [70, 70, 71], [104, 106, 104]], np.float64)
BALLASTS = np.array([[132, 126, 116], [118, 114, 106], [146, 137, 122]], np.float64)
# Zinc new and weathered, and what is painted over it.
FITTINGS = np.array(
    [[142, 146, 150], [122, 126, 130], [104, 108, 110], [88, 84, 80], [150, 148, 142], [84, 74, 66]], np.float64
)
WOODS = np.array([[96, 66, 44], [72, 50, 38], [58, 74, 66], [84, 46, 40], [112, 86, 60]], np.float64)
# The colours of a tone of 1.
SOFFIT = np.array([172.0, 170.28, 166.84])
ASPHALT, PAVING = np.array([1.0, 1.0, 1.02]), np.array([1.0, 0.985, 0.955])
# What ground is made of: surfaces, and leaves over them. The mean tone of each, whose grain it has, -1 for none, and the colour
# of a tone of 1 where no picture gives it.
GRAVEL, TAR, SLABS, SETTS, GRASS, WATER, TRACK, LEAVES = range(8)
assert SURFACES == ("gravel", "asphalt", "slabs", "setts", "grass", "water", "track")
MEANS = np.array([138.0, 98.0, 148.0, 140.0, 112.0, 96.0, 98.0, 96.0])
GRAINS = np.array([grain.GRAVEL, grain.ASPHALT, grain.SLABS, grain.SETTS, grain.GRASS, -1, grain.ASPHALT, -1])
COLOURS = np.array(
    [
        [1.05, 0.96, 0.82],
        ASPHALT,
        PAVING,
        [1.0, 0.985, 0.97],
        [0.8, 0.92, 0.46],
        [0.62, 0.78, 0.86],
        [1.3, 0.86, 0.76],
        [1.12, 0.84, 0.5],
    ]
)
# Fired clay and sand-lime of walls, and the mortar between; moss, of a tone of 1.
BRICKS = np.array([[142, 78, 58], [126, 66, 50], [158, 96, 68], [176, 140, 98]], np.float64)
MORTAR, MOSS = np.array([168.0, 162.0, 150.0]), np.array([82.0, 88.0, 54.0])
# A pane's colour where it shows no sky, and where it shows nothing else.
GLASS, SKY = np.array([44.0, 52.0, 60.0]), np.array([176.0, 198.0, 220.0])
# What is around a pane, upright and in a roof, of a tone of 1: so wide, and from the second width on a post in the middle.
FRAME, FLASHING, FRAME_M, POST_FROM_M, POST_M = (
    np.array([206.0, 204.0, 198.0]),
    np.array([70.0, 72.0, 76.0]),
    0.065,
    0.8,
    0.06,
)
# Width and visible length of a roof tile, of a slab; widths of a board and of a sheet of metal.
TILE_M, SLAB_M, BOARD_M, SHEET_M = (0.24, 0.34), (0.6, 0.4), (0.12, 1e9), 0.6
# Width and visible length of a slate, and the gap.
SLATE_M, GAP_M = (0.25, 0.2), 0.008
# A sheet of roofing felt, wide and long, and its lap; cells of which a share has a mended place; cells and weights of what says
# how deep water stands.
FELT_M, LAP_M, MENDED_M, MENDED = (1.0, 8.0), 0.05, 5.0, 0.3
POOLS_M, POOLS = (5.3, 2.2, 0.7), (0.7, 0.36, 0.12)
# Of that this is the shore, over so much of it; the shares of a roof under dried pools and at their shores.
SHORE, SHORE_WIDE, POOLED, SHORES = 0.3, 0.16, 0.146, 0.073
# How far streaks run down from a wall's upper edge, and how far up its foot is splashed.
STREAKS_M, SPLASHES_M = 5.0, 1.2
# The width of a sett across a street and its length.
SETT_M = (0.21, 0.15)
# A brick with its joint, a course high, and the joint.
BRICK_M, JOINT_M = (0.25, 0.078), 0.011


@njit(cache=True, inline="always")
def _rise(middle: float, length: float) -> float:
    """The integral of 3 t^2 - 2 t^3 over a piece of 0..1, of which it is exact in middle and length."""
    return length * (middle * middle * (3 - 2 * middle) + 0.25 * length * length * (1 - 2 * middle))


@njit(cache=True, inline="always", error_model="numpy")
def _noise(x: float, y: float, wide: float, high: float, seed: np.uint64) -> float:
    """Lattice noise around 0, -0.5..0.5, smooth from corner to corner of its cells: its mean over a box about x, y.

    All in cells. A box of more than one cell is taken as one, and fades until two.
    """
    fade = min(max(2.0 - max(wide, high), 0.0), 1.0)
    wide, high = min(wide, 1.0), min(high, 1.0)
    x0, y0 = np.floor(x - 0.5 * wide), np.floor(y - 0.5 * high)
    # of the box, what lies in the cell where it begins, and in the next
    right, below = max(x + 0.5 * wide - x0 - 1, 0.0), max(y + 0.5 * high - y0 - 1, 0.0)
    left, above = wide - right, high - below
    rise, fall = _rise(x - 0.5 * wide - x0 + 0.5 * left, left), _rise(0.5 * right, right)
    u0, u1, u2 = left - rise, rise + right - fall, fall
    rise, fall = _rise(y - 0.5 * high - y0 + 0.5 * above, above), _rise(0.5 * below, below)
    v0, v1, v2 = above - rise, rise + below - fall, fall
    a0, b0 = np.uint64(np.int64(x0)) * ACROSS, row_of(y0, seed)
    a1, b1 = a0 + ACROSS, b0 + DOWN
    a2, b2 = a1 + ACROSS, b1 + DOWN
    total = v0 * (u0 * mixed(a0 + b0) + u1 * mixed(a1 + b0) + u2 * mixed(a2 + b0))
    total += v1 * (u0 * mixed(a0 + b1) + u1 * mixed(a1 + b1) + u2 * mixed(a2 + b1))
    total += v2 * (u0 * mixed(a0 + b2) + u1 * mixed(a1 + b2) + u2 * mixed(a2 + b2))
    return fade * (total / (wide * high) - 0.5)


@njit(cache=True, inline="always", error_model="numpy")
def _covered(at: float, wide: float, first: float, width: float) -> float:
    """Of a piece `wide` about a place, the share on marks that begin at `first` and are `width` wide, one a unit."""
    low, high = at - 0.5 * wide - first, at + 0.5 * wide - first
    start, end = np.floor(low), np.floor(high)
    return ((end - start) * width + min(high - end, width) - min(low - start, width)) / wide


@njit(cache=True, inline="always", error_model="numpy")
def _bonded(column: float, row: float, wide: float, high: float, joint: float, across: float, down: float) -> float:
    """The share of a footprint that lies on no joint of a running bond, of which odd courses begin half a stone further.

    Place and footprint in stones; joint: its width, metres; across, down: stones to the metre.
    """
    beside, below = 0.5 * joint * across, 0.5 * joint * down
    even = _covered(0.5 * row, 0.5 * high, 0.5 * below, 0.5 - below)
    odd = _covered(0.5 * row, 0.5 * high, 0.5 + 0.5 * below, 0.5 - below)
    clear = even * _covered(column, wide, beside, 1 - 2 * beside)
    return clear + odd * _covered(column, wide, 0.5 + beside, 1 - 2 * beside)


@njit(cache=True, nogil=True, error_model="numpy")
def add_noise(
    x: np.ndarray, y: np.ndarray, side: np.ndarray, cell: tuple[float, float], weight: float, seed: int, out: np.ndarray
) -> None:
    """Add weight times noise around 0, -1..1, with cells of a width and height."""
    across, down, own = 1 / cell[0], 1 / cell[1], np.uint64(seed) * SEED
    for k in range(len(x)):
        out[k] += 2 * weight * _noise(x[k] * across, y[k] * down, side[k] * across, side[k] * down, own)


@njit(cache=True, nogil=True, error_model="numpy")
def add_tones(
    x: np.ndarray, y: np.ndarray, side: np.ndarray, cell: tuple[float, float], weight: float, seed: int, out: np.ndarray
) -> None:
    """Add weight times the tones of slabs, tiles or boards of a width and height, -0.5..0.5, odd rows half of one further.

    A footprint of more than one of them is taken as one, and fades until two.
    """
    across, down, own = 1 / cell[0], 1 / cell[1], np.uint64(seed) * SEED
    for k in range(len(x)):
        wide, high = side[k] * across, side[k] * down
        fade = min(max(2.0 - max(wide, high), 0.0), 1.0)
        wide, high = min(wide, 1.0), min(high, 1.0)
        left, top = x[k] * across - 0.5 * wide, y[k] * down - 0.5 * high
        y0 = np.floor(top)
        lower = max(top + high - y0 - 1, 0.0) / high
        odd = np.float64(np.int64(y0) & 1)
        x0, x1 = np.floor(left + 0.5 * odd), np.floor(left + 0.5 - 0.5 * odd)
        beside = max(left + 0.5 * odd + wide - x0 - 1, 0.0) / wide
        under = max(left + 0.5 - 0.5 * odd + wide - x1 - 1, 0.0) / wide
        a, b = (
            np.uint64(np.int64(x0)) * ACROSS + row_of(y0, own),
            np.uint64(np.int64(x1)) * ACROSS + row_of(y0 + 1, own),
        )
        upper = (1 - beside) * mixed(a) + beside * mixed(a + ACROSS)
        tone = (1 - lower) * upper + lower * ((1 - under) * mixed(b) + under * mixed(b + ACROSS))
        out[k] += weight * fade * (tone - 0.5)


@njit(cache=True, nogil=True, error_model="numpy")
def asphalt(x: np.ndarray, y: np.ndarray, aside: np.ndarray, side: np.ndarray, seed: int, out: np.ndarray) -> None:
    """Carriageway: worn asphalt, lighter in the wheel tracks; aside: from the centreline."""
    for k in range(len(x)):
        track = (aside[k] - 1.7) / 0.5
        bump = max(1 - 0.125 * track * track, 0.0)  # to its eighth power: nearly exp(-track^2)
        bump *= bump
        bump *= bump
        out[k] = 98 + 5 * bump * bump
    for number, cell in enumerate((0.15, 0.6, 4.0)):
        add_noise(x, y, side, (cell, cell), 13 / 3, seed + number, out)


@njit(cache=True, nogil=True, error_model="numpy")
def paving(x: np.ndarray, y: np.ndarray, side: np.ndarray, seed: int, out: np.ndarray) -> None:
    """Pavement of slabs, 0.6 x 0.4 m in running bond, with darker joints, 4 cm wide."""
    out[:] = 148
    for number, cell in enumerate((0.2, 1.5, 6.0)):
        add_noise(x, y, side, (cell, cell), 10 / 3, seed + 3 + number, out)
    add_tones(x, y, side, SLAB_M, 14, seed + 11, out)
    across, down = 1 / SLAB_M[0], 1 / SLAB_M[1]
    for k in range(len(x)):
        column, row, wide, high = x[k] * across, y[k] * down, side[k] * across, side[k] * down
        clear = _bonded(column, row, wide, high, 0.04, across, down)
        out[k] *= 0.86 + 0.14 * clear


@njit(cache=True, nogil=True, error_model="numpy")
def roofing(x: np.ndarray, y: np.ndarray, side: np.ndarray, seed: int, out: np.ndarray) -> None:
    """Sheet-metal roof with standing seams every 0.6 m."""
    for k in range(len(x)):
        out[k] = 1 - 0.12 * _covered(x[k] / SHEET_M, side[k] / SHEET_M, -0.04 / SHEET_M, 0.08 / SHEET_M)
    add_noise(x, y, side, (0.8, 0.8), 0.05, seed + 7, out)
    add_noise(x, y, side, (5.0, 5.0), 0.05, seed + 8, out)


@njit(cache=True, nogil=True, error_model="numpy")
def tiling(x: np.ndarray, y: np.ndarray, side: np.ndarray, seed: int, out: np.ndarray) -> None:
    """Tilted roof of clay tiles in rows that overlap down the slope."""
    across, down = 1 / TILE_M[0], 1 / TILE_M[1]
    for k in range(len(x)):
        column, row, wide, high = x[k] * across, y[k] * down, side[k] * across, side[k] * down
        # highest in a tile's middle, and half a tile further in odd rows: a wave of cubics, nearly a cosine
        even = _covered(0.5 * row, 0.5 * high, 0.0, 0.5)
        away = 2 * abs(column - np.floor(column + 0.5))
        wave = 1 - 2 * away * away * (3 - 2 * away)
        # of which the mean over a part w of it is sin(pi w) / (pi w) as high, up to the whole
        square = min(wide * wide, 1.0)
        wave *= (1 - square) * (1 - 0.6449 * square + 0.19 * square * square)
        out[k] = 1 + 0.05 * (1 - 2 * even) * wave - 0.22 * _covered(row, high, 0.86, 0.14)
    add_tones(x, y, side, TILE_M, 0.10, seed + 23, out)
    add_noise(x, y, side, (0.8, 0.8), 0.04, seed + 29, out)
    add_noise(x, y, side, (5.0, 5.0), 0.04, seed + 30, out)


@njit(cache=True, nogil=True, error_model="numpy")
def slates(x: np.ndarray, y: np.ndarray, side: np.ndarray, seed: int, out: np.ndarray) -> None:
    """Tilted roof of slates, no two of one grey; the lower edge of each casts a thin shadow."""
    out[:] = 1.0
    add_noise(x, y, side, (1.6, 1.1), 0.06, seed + 91, out)
    add_noise(x, y, side, (6.0, 6.0), 0.06, seed + 92, out)
    add_tones(x, y, side, SLATE_M, 0.34, seed + 93, out)
    across, down = 1 / SLATE_M[0], 1 / SLATE_M[1]
    for k in range(len(x)):
        column, row, wide, high = x[k] * across, y[k] * down, side[k] * across, side[k] * down
        clear = _bonded(column, row, wide, high, GAP_M, across, down)
        out[k] *= (0.62 + 0.38 * clear) * (1 - 0.2 * _covered(row, high, 0.9, 0.1))


@njit(cache=True, nogil=True, error_model="numpy")
def felt(x: np.ndarray, y: np.ndarray, side: np.ndarray, seed: int, out: np.ndarray) -> None:
    """Roof of bitumen felt: sheets that lap, no two of one grey, mended places, and where water stood. Sheets run along y."""
    out[:] = 1.0
    add_noise(x, y, side, (1.7, 1.7), 0.04, seed + 95, out)
    add_noise(x, y, side, (6.0, 6.0), 0.05, seed + 96, out)
    add_tones(y, x, side, (FELT_M[1], FELT_M[0]), 0.11, seed + 101, out)
    add_mended(x, y, side, seed + 102, out)
    add_pools(x, y, side, seed + 105, out)
    across, down = 1 / FELT_M[1], 1 / FELT_M[0]
    for k in range(len(x)):
        clear = _bonded(y[k] * across, x[k] * down, side[k] * across, side[k] * down, LAP_M, across, down)
        out[k] *= 0.84 + 0.16 * clear


@njit(cache=True, nogil=True, error_model="numpy")
def ballast(x: np.ndarray, y: np.ndarray, side: np.ndarray, seed: int, out: np.ndarray) -> None:
    """Flat roof under gravel: thinner here and there, and where water stood."""
    out[:] = 1.0
    add_noise(x, y, side, (0.9, 0.9), 0.05, seed + 108, out)
    add_noise(x, y, side, (7.0, 7.0), 0.08, seed + 109, out)
    add_pools(x, y, side, seed + 105, out)


@njit(cache=True, nogil=True, error_model="numpy")
def add_mended(x: np.ndarray, y: np.ndarray, side: np.ndarray, seed: int, out: np.ndarray) -> None:
    """Add the tones of mended places, -0.12..0.12: rectangles, one a cell at most, which chance puts well within it.

    A footprint that could reach a neighbouring cell's is too large to show any: they fade until half a cell.
    """
    own = np.uint64(seed) * SEED
    for k in range(len(x)):
        u, v = x[k] / MENDED_M, y[k] / MENDED_M
        column, row = np.floor(u), np.floor(v)
        h = np.uint64(np.int64(column)) * ACROSS + row_of(row, own)
        some = np.float64(mixed(h) < MENDED)
        wide, long = 0.12 + 0.3 * mixed(h + np.uint64(1)), 0.1 + 0.25 * mixed(h + np.uint64(2))
        left, low = 0.1 + (0.8 - wide) * mixed(h + np.uint64(3)), 0.1 + (0.8 - long) * mixed(h + np.uint64(4))
        size = side[k] / MENDED_M
        u, v = u - column, v - row
        beside = max(min(u + 0.5 * size, left + wide) - max(u - 0.5 * size, left), 0.0)
        below = max(min(v + 0.5 * size, low + long) - max(v - 0.5 * size, low), 0.0)
        fade = min(max(2.0 - 4.0 * size, 0.0), 1.0)
        out[k] += fade * some * 0.24 * (mixed(h + np.uint64(5)) - 0.5) * beside * below / (size * size)


@njit(cache=True, nogil=True, error_model="numpy")
def add_pools(x: np.ndarray, y: np.ndarray, side: np.ndarray, seed: int, out: np.ndarray) -> None:
    """Add what pools leave when they dry, on a flat roof: darker where water stood, pale silt along its edge.

    A footprint as wide as a shore has the mean of all the roof.
    """
    depth = np.zeros(len(x))
    for number in range(3):
        add_noise(x, y, side, (POOLS_M[number], POOLS_M[number]), POOLS[number], seed + number, depth)
    for k in range(len(x)):
        wet = min(max((depth[k] - SHORE) / SHORE_WIDE, 0.0), 1.0)
        fine = min(max(2.0 - 2.0 * side[k], 0.0), 1.0)
        pooled, shore = POOLED + fine * (wet - POOLED), SHORES + fine * (4 * wet * (1 - wet) - SHORES)
        out[k] += 0.09 * shore - 0.1 * pooled


@njit(cache=True, nogil=True, error_model="numpy")
def add_weather(
    x: np.ndarray, y: np.ndarray, above: np.ndarray, below: np.ndarray, side: np.ndarray, seed: int, out: np.ndarray
) -> None:
    """Take from a wall's tones what rain leaves: streaks below its upper edge, and splashes at its foot.

    above: its building's foot; below: its upper edge, both metres.
    """
    near = np.zeros(len(x))
    top, foot = np.inf, np.inf
    for k in range(len(x)):
        top, foot = min(top, below[k]), min(foot, above[k])
    if top < STREAKS_M:
        add_noise(x, y, side, (0.16, 5.0), 0.5, seed + 97, near)
        add_noise(x, y, side, (0.5, 9.0), 0.5, seed + 98, near)
        for k in range(len(x)):
            run = max(1 - max(below[k], 0.0) / STREAKS_M, 0.0)
            out[k] -= 0.3 * max(near[k] - 0.12, 0.0) * run * run * run
    if foot < SPLASHES_M:
        for k in range(len(x)):
            near[k] = 0.25
        add_noise(x, y, side, (0.45, 0.3), 0.5, seed + 99, near)
        add_noise(x, y, side, (2.2, 4.0), 0.5, seed + 100, near)
        for k in range(len(x)):
            wet = max(1 - max(above[k], 0.0) / SPLASHES_M, 0.0)
            out[k] -= 0.26 * max(near[k], 0.0) * wet * wet


@njit(cache=True, nogil=True, error_model="numpy")
def plaster(x: np.ndarray, y: np.ndarray, above: np.ndarray, side: np.ndarray, seed: int, out: np.ndarray) -> None:
    """Bare rendered wall, dirtier near the ground; above: its building's foot."""
    for k in range(len(x)):
        dirt = max(1 - max(above[k], 0.0) / 11.2, 0.0)  # to its 16th power: nearly exp(-above / 0.7)
        for _ in range(4):
            dirt *= dirt
        out[k] = 1 - 0.16 * dirt
    for number, cell in enumerate((0.25, 1.2, 5.0)):
        add_noise(x, y, side, (cell, cell), 0.02, seed + 13 + number, out)
    add_noise(x, y, side, (0.3, 1.1), 0.025, seed + 17, out)


@njit(cache=True, nogil=True, error_model="numpy")
def brick(
    x: np.ndarray, y: np.ndarray, above: np.ndarray, side: np.ndarray, seed: int, mortar: np.ndarray, out: np.ndarray
) -> None:
    """Wall of bricks in running bond, dirtier near the ground; mortar gets the share of the joints; above: as plaster's."""
    plaster(x, y, above, side, seed, out)
    add_tones(x, y, side, BRICK_M, 0.34, seed + 53, out)
    across, down = 1 / BRICK_M[0], 1 / BRICK_M[1]
    for k in range(len(x)):
        column, row, wide, high = x[k] * across, y[k] * down, side[k] * across, side[k] * down
        mortar[k] = 1 - _bonded(column, row, wide, high, JOINT_M, across, down)


@njit(cache=True, nogil=True, error_model="numpy")
def moss(x: np.ndarray, y: np.ndarray, side: np.ndarray, most: float, seed: int, out: np.ndarray) -> None:
    """The share of a roof under moss, in cushions along the courses; most: of the worst place."""
    out[:] = -0.25
    add_noise(x, y, side, (2.6, 1.7), 0.75, seed + 59, out)
    add_noise(x, y, side, (0.3, 0.22), 0.45, seed + 60, out)
    for k in range(len(x)):
        out[k] = most * min(max(2 * out[k], 0.0), 1.0)


@njit(cache=True, nogil=True, error_model="numpy")
def glass(x: np.ndarray, y: np.ndarray, height: float, side: np.ndarray, seed: int, out: np.ndarray) -> None:
    """Window pane: dark, with more sky in it towards its top; height: the pane's, y: down from its top. A share of SKY."""
    out[:] = 0.0
    add_noise(x, y, side, (0.7, 0.7), 0.5, seed + 31, out)
    add_noise(x, y, side, (2.5, 2.5), 0.5, seed + 32, out)
    for k in range(len(x)):
        sky = min(max(1 - y[k] / max(height, 0.1), 0.0), 1.0)
        out[k] = 0.55 * (sky * sky * (1 + 0.3 * out[k]) + 0.08 * out[k])


@njit(cache=True, nogil=True, error_model="numpy")
def framed(x: np.ndarray, y: np.ndarray, wide: float, high: float, side: np.ndarray, out: np.ndarray) -> None:
    """The share of a pane's places that is frame; wide, high: the whole pane, x and y from its upper left."""
    post = 0.5 * POST_M if wide > POST_FROM_M else -1e9
    for k in range(len(x)):
        across = (min(x[k], wide - x[k]) - FRAME_M) / side[k] + 0.5
        down = (min(y[k], high - y[k]) - FRAME_M) / side[k] + 0.5
        beside = (abs(x[k] - 0.5 * wide) - post) / side[k] + 0.5
        clear = min(max(across, 0.0), 1.0) * min(max(down, 0.0), 1.0) * min(max(beside, 0.0), 1.0)
        out[k] = 1 - clear


@njit(cache=True, nogil=True, error_model="numpy")
def wood(x: np.ndarray, y: np.ndarray, side: np.ndarray, seed: int, out: np.ndarray) -> None:
    """Door of upright boards 0.12 m wide."""
    for k in range(len(x)):
        out[k] = 1 - 0.35 * _covered(x[k] / BOARD_M[0], side[k] / BOARD_M[0], -0.06, 0.12)
    add_noise(x, y, side, (0.02, 0.6), 0.08, seed + 41, out)
    add_tones(x, y, side, BOARD_M, 0.24, seed + 43, out)


@njit(cache=True, nogil=True, error_model="numpy")
def soffit(x: np.ndarray, y: np.ndarray, side: np.ndarray, seed: int, out: np.ndarray) -> None:
    """Grey plaster of what is seen from below."""
    out[:] = 1.0
    for number, cell in enumerate((0.3, 1.5, 5.0)):
        add_noise(x, y, side, (cell, cell), 0.05 / 3, seed + 47 + number, out)


@njit(cache=True, nogil=True, error_model="numpy")
def fitting(
    x: np.ndarray,
    y: np.ndarray,
    right: np.ndarray,
    down: np.ndarray,
    wide: float,
    high: float,
    side: np.ndarray,
    seed: int,
    out: np.ndarray,
) -> None:
    """Gutters, pipes and vents of sheet metal, round: darker to both sides of their narrower way; right, down: on a piece so
    wide and high."""
    across, narrow = (right, wide) if wide < high else (down, high)
    for k in range(len(x)):
        turned = 2 * min(max(across[k] / narrow, 0.0), 1.0) - 1
        out[k] = 1.04 - 0.34 * turned * turned
    add_noise(x, y, side, (0.3, 0.3), 0.05, seed + 111, out)
    add_noise(x, y, side, (1.8, 1.8), 0.05, seed + 112, out)


@njit(cache=True, nogil=True, error_model="numpy")
def setts(x: np.ndarray, y: np.ndarray, side: np.ndarray, seed: int, out: np.ndarray) -> None:
    """Granite setts in courses across the street, of which x runs along; joints darker."""
    out[:] = 140
    add_noise(y, x, side, (1.1, 1.1), 5.0, seed + 62, out)
    add_noise(y, x, side, (6.0, 6.0), 7.0, seed + 63, out)
    add_tones(y, x, side, SETT_M, 30.0, seed + 64, out)
    right, up = 1 / SETT_M[0], 1 / SETT_M[1]
    for k in range(len(x)):
        column, row, wide, high = y[k] * right, x[k] * up, side[k] * right, side[k] * up
        out[k] *= 0.68 + 0.32 * _bonded(column, row, wide, high, 0.024, right, up)


@njit(cache=True, nogil=True, error_model="numpy")
def ground(
    made: int,
    x: np.ndarray,
    y: np.ndarray,
    aside: np.ndarray,
    side: np.ndarray,
    grains: grain.Grains,
    seed: int,
    out: np.ndarray,
) -> None:
    """What a surface is like, 0..255."""
    if made in (TAR, TRACK):
        asphalt(x, y, aside, side, seed, out)
    elif made == SLABS:
        paving(x, y, side, seed, out)
    elif made == SETTS:
        setts(x, y, side, seed, out)
    else:
        out[:] = MEANS[made]
    if made == GRAVEL:
        for number, cell in enumerate((0.9, 5.0)):
            add_noise(x, y, side, (cell, cell), (5.0, 7.0)[number], seed + 53 + number, out)
    elif made == GRASS:
        for number, cell in enumerate((1.5, 7.0)):
            add_noise(x, y, side, (cell, cell), (7.0, 8.0)[number], seed + 57 + number, out)
    elif made == WATER:
        add_noise(x, y, side, (1.6, 0.5), 7.0, seed + 59, out)
        add_noise(x, y, side, (9.0, 9.0), 6.0, seed + 60, out)
    elif made == LEAVES:
        add_noise(x, y, side, (0.12, 0.12), 30.0, seed + 83, out)
    if GRAINS[made] >= 0:
        grain.add_grain(x, y, side, grains, GRAINS[made], MEANS[made], seed + 71, out)
