"""Procedural materials of ground, walls and openings, one kernel each.

All arrays are (n,), in branch-free loops that vectorise; tones are averaged over footprints; lengths are metres; a
footprint is the side of a square, greater than 0. `patterns` has the ingredients, `roofs` the roofs.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from facade_core.core.arrays import Float64Array
from facade_core.core.numba_cache import njit
from facade_core.core.types import SURFACES
from facade_core.street.materials.grain import GrainKind, GrainTables, add_grain
from facade_core.street.materials.patterns import add_noise, add_piece_tones, running_bond_stone_share, stripe_share
from facade_core.street.materials.settings import PROCEDURAL

# Muted Nordic plasters.
PLASTER_PALETTE = np.array(
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
# New and weathered zinc, and paints.
METAL_FIXTURE_PALETTE = np.array(
    [[142, 146, 150], [122, 126, 130], [104, 108, 110], [88, 84, 80], [150, 148, 142], [84, 74, 66]], np.float64
)
WOOD_PALETTE = np.array([[96, 66, 44], [72, 50, 38], [58, 74, 66], [84, 46, 40], [112, 86, 60]], np.float64)
# Colours of a tone of 1.
SOFFIT_COLOUR = np.array([172.0, 170.28, 166.84])
ASPHALT_COLOUR = np.array([1.0, 1.0, 1.02])
PAVING_COLOUR = np.array([1.0, 0.985, 0.955])


class GroundSurface(IntEnum):
    """Surfaces of the ground: those of `SURFACES`, and leaves over them."""

    GRAVEL = 0
    ASPHALT = 1
    SLABS = 2
    SETTS = 3
    GRASS = 4
    WATER = 5
    TRACK = 6
    LEAVES = 7


assert SURFACES == ("gravel", "asphalt", "slabs", "setts", "grass", "water", "track")
# Mean tone, grain (-1 for none) and colour of a tone of 1 without a picture, by `GroundSurface`.
MEAN_TONES = np.array([138.0, 98.0, 148.0, 140.0, 112.0, 96.0, 98.0, 96.0])
SURFACE_GRAINS = np.array(
    [GrainKind.GRAVEL, GrainKind.ASPHALT, GrainKind.SLABS, GrainKind.SETTS, GrainKind.GRASS, -1, GrainKind.ASPHALT, -1]
)
SURFACE_COLOURS = np.array(
    [
        [1.05, 0.96, 0.82],
        ASPHALT_COLOUR,
        PAVING_COLOUR,
        [1.0, 0.985, 0.97],
        [0.8, 0.92, 0.46],
        [0.62, 0.78, 0.86],
        [1.3, 0.86, 0.76],
        [1.12, 0.84, 0.5],
    ]
)
# Fired clay and sand-lime.
BRICK_PALETTE = np.array([[142, 78, 58], [126, 66, 50], [158, 96, 68], [176, 140, 98]], np.float64)
MORTAR_COLOUR = np.array([168.0, 162.0, 150.0])
# A pane without reflection, and the sky that it reflects.
GLASS_COLOUR = np.array([44.0, 52.0, 60.0])
REFLECTED_SKY_COLOUR = np.array([176.0, 198.0, 220.0])
# Frame of an upright pane, and of one in a roof.
FRAME_COLOUR = np.array([206.0, 204.0, 198.0])
FLASHING_COLOUR = np.array([70.0, 72.0, 76.0])


@njit(cache=True, nogil=True, error_model="numpy")
def asphalt_tone(
    x: Float64Array, y: Float64Array, aside: Float64Array, side: Float64Array, seed: int, out: Float64Array
) -> None:
    """Write tones of worn asphalt, lighter in the wheel tracks.

    Parameters
    ----------
    x, y : (n,) coordinates, metres.
    aside : (n,) distance from the centreline, metres.
    side : (n,) footprints, metres.
    seed : random seed.
    out : (n,) output tones, 0..255.
    """
    for k in range(len(x)):
        track = (aside[k] - 1.7) / 0.5
        bump = max(1 - 0.125 * track * track, 0.0)  # to its eighth power: nearly exp(-track^2)
        bump *= bump
        bump *= bump
        out[k] = 98 + 5 * bump * bump
    for number, cell in enumerate((0.15, 0.6, 4.0)):
        add_noise(x, y, side, (cell, cell), 13 / 3, seed + number, out)


@njit(cache=True, nogil=True, error_model="numpy")
def paving_tone(x: Float64Array, y: Float64Array, side: Float64Array, seed: int, out: Float64Array) -> None:
    """Write tones of pavement slabs, 0.6 x 0.4 m in running bond, with joints 4 cm wide."""
    out[:] = 148
    for number, cell in enumerate((0.2, 1.5, 6.0)):
        add_noise(x, y, side, (cell, cell), 10 / 3, seed + 3 + number, out)
    add_piece_tones(x, y, side, PROCEDURAL.slab_m, 14.0, seed + 11, out)
    across, down = 1 / PROCEDURAL.slab_m[0], 1 / PROCEDURAL.slab_m[1]
    for k in range(len(x)):
        column, row, wide, high = x[k] * across, y[k] * down, side[k] * across, side[k] * down
        clear = running_bond_stone_share(column, row, wide, high, 0.04, across, down)
        out[k] *= 0.86 + 0.14 * clear


@njit(cache=True, nogil=True, error_model="numpy")
def add_rain_weathering(
    x: Float64Array,
    y: Float64Array,
    above: Float64Array,
    below: Float64Array,
    side: Float64Array,
    seed: int,
    out: Float64Array,
) -> None:
    """Darken a wall's tones by rain: streaks below its upper edge, splashes at its foot.

    Parameters
    ----------
    x, y : (n,) coordinates, metres.
    above : (n,) height over the building's foot, metres.
    below : (n,) distance from the upper edge, metres.
    side : (n,) footprints, metres.
    seed : random seed.
    out : (n,) tones, changed in place.
    """
    near = np.zeros(len(x))
    top, foot = np.inf, np.inf
    for k in range(len(x)):
        top, foot = min(top, below[k]), min(foot, above[k])
    if top < PROCEDURAL.streak_length_m:
        add_noise(x, y, side, (0.16, 5.0), 0.5, seed + 97, near)
        add_noise(x, y, side, (0.5, 9.0), 0.5, seed + 98, near)
        for k in range(len(x)):
            run = max(1 - max(below[k], 0.0) / PROCEDURAL.streak_length_m, 0.0)
            out[k] -= 0.3 * max(near[k] - 0.12, 0.0) * run * run * run
    if foot < PROCEDURAL.splash_height_m:
        for k in range(len(x)):
            near[k] = 0.25
        add_noise(x, y, side, (0.45, 0.3), 0.5, seed + 99, near)
        add_noise(x, y, side, (2.2, 4.0), 0.5, seed + 100, near)
        for k in range(len(x)):
            wet = max(1 - max(above[k], 0.0) / PROCEDURAL.splash_height_m, 0.0)
            out[k] -= 0.26 * max(near[k], 0.0) * wet * wet


@njit(cache=True, nogil=True, error_model="numpy")
def plaster_tone(
    x: Float64Array, y: Float64Array, above: Float64Array, side: Float64Array, seed: int, out: Float64Array
) -> None:
    """Write tones of a rendered wall, dirtier near the ground.

    Parameters
    ----------
    x, y : (n,) coordinates, metres.
    above : (n,) height over the building's foot, metres.
    side : (n,) footprints, metres.
    seed : random seed.
    out : (n,) output tones, about 1.
    """
    for k in range(len(x)):
        dirt = max(1 - max(above[k], 0.0) / 11.2, 0.0)  # to its 16th power: nearly exp(-above / 0.7)
        for _ in range(4):
            dirt *= dirt
        out[k] = 1 - 0.16 * dirt
    for number, cell in enumerate((0.25, 1.2, 5.0)):
        add_noise(x, y, side, (cell, cell), 0.02, seed + 13 + number, out)
    add_noise(x, y, side, (0.3, 1.1), 0.025, seed + 17, out)


@njit(cache=True, nogil=True, error_model="numpy")
def brick_tone(
    x: Float64Array,
    y: Float64Array,
    above: Float64Array,
    side: Float64Array,
    seed: int,
    mortar: Float64Array,
    out: Float64Array,
) -> None:
    """Write tones of a brick wall in running bond and the share of mortar.

    Parameters
    ----------
    x, y : (n,) coordinates, metres.
    above : (n,) height over the building's foot, metres.
    side : (n,) footprints, metres.
    seed : random seed.
    mortar : (n,) output share of the joints.
    out : (n,) output tones.
    """
    plaster_tone(x, y, above, side, seed, out)
    add_piece_tones(x, y, side, PROCEDURAL.brick_m, 0.34, seed + 53, out)
    across, down = 1 / PROCEDURAL.brick_m[0], 1 / PROCEDURAL.brick_m[1]
    for k in range(len(x)):
        column, row, wide, high = x[k] * across, y[k] * down, side[k] * across, side[k] * down
        mortar[k] = 1 - running_bond_stone_share(column, row, wide, high, PROCEDURAL.joint_m, across, down)


@njit(cache=True, nogil=True, error_model="numpy")
def glass_reflection(
    x: Float64Array, y: Float64Array, height: float, side: Float64Array, seed: int, out: Float64Array
) -> None:
    """Write the share of reflected sky in a window pane, more towards its top.

    Parameters
    ----------
    x, y : (n,) coordinates, metres; y down from the pane's top.
    height : height of the pane, metres.
    side : (n,) footprints, metres.
    seed : random seed.
    out : (n,) output share of REFLECTED_SKY_COLOUR.
    """
    out[:] = 0.0
    add_noise(x, y, side, (0.7, 0.7), 0.5, seed + 31, out)
    add_noise(x, y, side, (2.5, 2.5), 0.5, seed + 32, out)
    for k in range(len(x)):
        sky = min(max(1 - y[k] / max(height, 0.1), 0.0), 1.0)
        out[k] = 0.55 * (sky * sky * (1 + 0.3 * out[k]) + 0.08 * out[k])


@njit(cache=True, nogil=True, error_model="numpy")
def frame_share(
    x: Float64Array, y: Float64Array, wide: float, high: float, side: Float64Array, out: Float64Array
) -> None:
    """Write the share of frame in a pane.

    Parameters
    ----------
    x, y : (n,) coordinates from the pane's upper left, metres.
    wide, high : size of the pane, metres.
    side : (n,) footprints, metres.
    out : (n,) output share.
    """
    post = 0.5 * PROCEDURAL.post_m if wide > PROCEDURAL.min_width_with_post_m else -1e9
    for k in range(len(x)):
        across = (min(x[k], wide - x[k]) - PROCEDURAL.frame_m) / side[k] + 0.5
        down = (min(y[k], high - y[k]) - PROCEDURAL.frame_m) / side[k] + 0.5
        post_clear = (abs(x[k] - 0.5 * wide) - post) / side[k] + 0.5
        clear = min(max(across, 0.0), 1.0) * min(max(down, 0.0), 1.0) * min(max(post_clear, 0.0), 1.0)
        out[k] = 1 - clear


@njit(cache=True, nogil=True, error_model="numpy")
def door_boards_tone(x: Float64Array, y: Float64Array, side: Float64Array, seed: int, out: Float64Array) -> None:
    """Write tones of a door of upright boards, 0.12 m wide."""
    for k in range(len(x)):
        out[k] = 1 - 0.35 * stripe_share(x[k] / PROCEDURAL.board_m[0], side[k] / PROCEDURAL.board_m[0], -0.06, 0.12)
    add_noise(x, y, side, (0.02, 0.6), 0.08, seed + 41, out)
    add_piece_tones(x, y, side, PROCEDURAL.board_m, 0.24, seed + 43, out)


@njit(cache=True, nogil=True, error_model="numpy")
def soffit_tone(x: Float64Array, y: Float64Array, side: Float64Array, seed: int, out: Float64Array) -> None:
    """Write tones of grey plaster on surfaces seen from below."""
    out[:] = 1.0
    for number, cell in enumerate((0.3, 1.5, 5.0)):
        add_noise(x, y, side, (cell, cell), 0.05 / 3, seed + 47 + number, out)


@njit(cache=True, nogil=True, error_model="numpy")
def metal_fixture_colour(
    x: Float64Array,
    y: Float64Array,
    right: Float64Array,
    down: Float64Array,
    wide: float,
    high: float,
    side: Float64Array,
    seed: int,
    out: Float64Array,
) -> None:
    """Write tones of gutters, pipes and vents, darker towards both sides.

    Parameters
    ----------
    x, y : (n,) coordinates, metres.
    right, down : (n,) coordinates on the piece, metres.
    wide, high : size of the piece, metres.
    side : (n,) footprints, metres.
    seed : random seed.
    out : (n,) output tones.
    """
    across, narrow = (right, wide) if wide < high else (down, high)
    for k in range(len(x)):
        turned = 2 * min(max(across[k] / narrow, 0.0), 1.0) - 1
        out[k] = 1.04 - 0.34 * turned * turned
    add_noise(x, y, side, (0.3, 0.3), 0.05, seed + 111, out)
    add_noise(x, y, side, (1.8, 1.8), 0.05, seed + 112, out)


@njit(cache=True, nogil=True, error_model="numpy")
def setts_tone(x: Float64Array, y: Float64Array, side: Float64Array, seed: int, out: Float64Array) -> None:
    """Write tones of granite setts in courses across the street; x runs along it."""
    out[:] = 140
    add_noise(y, x, side, (1.1, 1.1), 5.0, seed + 62, out)
    add_noise(y, x, side, (6.0, 6.0), 7.0, seed + 63, out)
    add_piece_tones(y, x, side, PROCEDURAL.sett_m, 30.0, seed + 64, out)
    right, up = 1 / PROCEDURAL.sett_m[0], 1 / PROCEDURAL.sett_m[1]
    for k in range(len(x)):
        column, row, wide, high = y[k] * right, x[k] * up, side[k] * right, side[k] * up
        out[k] *= 0.68 + 0.32 * running_bond_stone_share(column, row, wide, high, 0.024, right, up)


@njit(cache=True, nogil=True, error_model="numpy")
def ground_tone(
    surface: int,
    x: Float64Array,
    y: Float64Array,
    aside: Float64Array,
    side: Float64Array,
    grains: GrainTables,
    seed: int,
    out: Float64Array,
) -> None:
    """Write tones, 0..255, of a ground surface.

    Parameters
    ----------
    surface : `GroundSurface`.
    x, y : (n,) coordinates, metres.
    aside : (n,) distance from the centreline, metres.
    side : (n,) footprints, metres.
    grains : tables of all grains.
    seed : random seed.
    out : (n,) output tones.
    """
    if surface in (GroundSurface.ASPHALT, GroundSurface.TRACK):
        asphalt_tone(x, y, aside, side, seed, out)
    elif surface == GroundSurface.SLABS:
        paving_tone(x, y, side, seed, out)
    elif surface == GroundSurface.SETTS:
        setts_tone(x, y, side, seed, out)
    else:
        out[:] = MEAN_TONES[surface]
    if surface == GroundSurface.GRAVEL:
        for number, cell in enumerate((0.9, 5.0)):
            add_noise(x, y, side, (cell, cell), (5.0, 7.0)[number], seed + 53 + number, out)
    elif surface == GroundSurface.GRASS:
        for number, cell in enumerate((1.5, 7.0)):
            add_noise(x, y, side, (cell, cell), (7.0, 8.0)[number], seed + 57 + number, out)
    elif surface == GroundSurface.WATER:
        add_noise(x, y, side, (1.6, 0.5), 7.0, seed + 59, out)
        add_noise(x, y, side, (9.0, 9.0), 6.0, seed + 60, out)
    elif surface == GroundSurface.LEAVES:
        add_noise(x, y, side, (0.12, 0.12), 30.0, seed + 83, out)
    if SURFACE_GRAINS[surface] >= 0:
        add_grain(x, y, side, grains, SURFACE_GRAINS[surface], MEAN_TONES[surface], seed + 71, out)
