"""Bare wall of a composed wall: above and below windows, where nothing fits, and its plain top."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise

import numpy as np
import shapely
from numpy.lib.stride_tricks import sliding_window_view

from facade_core.core.arrays import Float64Array, Int32Array, IntArray, UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.facade.texture.retargeting import ExemplarAnalysis
from facade_core.facade.texture.settings import BAYS, ENTRANCES, FLOORS
from facade_core.facade.texture.wall_floors import FacadeWall, WallFloor, is_level, shows_ground_floor
from facade_core.facade.wall_material import lit_colour, paint_plaster


def plaster_bare_wall(
    stack: list[WallFloor], image: UInt8Array, labels: UInt8Array, rows: IntArray, pixel: float
) -> None:
    """Plaster the bare wall above floors in the colour of the wall below it, on a ledge, in place.

    The pier that it repeats is narrow: its shade and remains of ornament would repeat too. The ledge covers cut ornament.
    """
    for wall_floor, own in zip(stack, floor_rows(stack), strict=True):
        if wall_floor.attic == 0:
            continue
        band = slice(rows[own.start - 1], rows[own.start])
        beside = slice(band.stop, (band.stop + int(rows[own.stop]) + 1) // 2)
        wall = labels[beside] == FacadeClass.WALL
        if band.start == band.stop or not wall.any():
            continue
        colour = lit_colour(image[beside][wall])
        image[band] = paint_plaster(labels[band].shape, colour, FLOORS.grain)
        labels[band] = FacadeClass.WALL
        _paint_ledge(image, colour, band, pixel)


def _paint_ledge(image: UInt8Array, colour: Float64Array, band: slice, pixel: float) -> None:
    """Paint a ledge of a wall's colour (3,) at the foot of a band of rows, and its shadow below, in place."""
    high = max(1, round(FLOORS.coping_m / pixel))
    image[max(band.start, band.stop - high) : band.stop] = np.minimum(colour / FLOORS.ledge_light, 255)
    shadow = image[band.stop : band.stop + max(1, high // 2)]
    shadow[:] = FLOORS.coping_light * shadow


def paint_coping(wall: FacadeWall, highest: WallFloor, image: UInt8Array, pixel: float) -> None:
    """Darken the edge of a plain and level top, in place."""
    if highest.attic > 0 and is_level(wall):
        coping = image[: max(1, round(FLOORS.coping_m / pixel))]
        coping[:] = FLOORS.coping_light * coping


def floor_rows(stack: list[WallFloor]) -> list[slice]:
    """Return the rows of each floor's own bands, without bare wall, among the rows of a wall."""
    found, row = [], 0
    for wall_floor in stack:
        first = row + (wall_floor.attic > 0)
        found.append(slice(first, first + len(wall_floor.heights)))
        row += len(wall_floor.all_heights)
    return found


def insert_bare_rows(style: ExemplarAnalysis, stack: list[WallFloor], source: Int32Array, plain: int) -> Int32Array:
    """Insert bare wall above and below floors into the rows of `source` (2, M, N), see `blank_cells`.

    It is the wall of the floor itself where that is bare beside its windows.
    """
    whole = np.empty((2, sum(len(one.all_heights) for one in stack), source.shape[2]), source.dtype)
    whole[1] = len(style.grid.columns)
    row = 0
    for wall_floor in stack:
        beside = np.array([3 * wall_floor.exemplar_floor + 1])
        is_bare = wall_floor.exemplar_floor >= 0 and _is_mostly_wall(style, beside, plain, BAYS.min_corner_wall_share)
        end = row + len(wall_floor.all_heights)
        whole[0, row:end], row = beside if is_bare else 3 * plain + 1, end
    whole[:, np.concatenate([np.arange(own.start, own.stop) for own in floor_rows(stack)])] = source
    return whole


def blank_ground(style: ExemplarAnalysis, wall_floor: WallFloor, source: Int32Array, plain: int) -> None:
    """Replace the lowest floor by bare wall, from the exemplar's ground floor if that has any.

    `source` as in `blank_cells`, of the rows of that floor.
    """
    count, bare = len(wall_floor.heights), len(style.grid.columns)
    if not (
        shows_ground_floor(style, wall_floor)
        and _is_mostly_wall(style, source[0, :, 0], plain, BAYS.min_corner_wall_share)
    ):
        own = 3 * plain + np.arange(count) if count == 3 else np.array([3 * plain + 1])
        source[0] = own[:, None]
    source[1] = bare


def blank_cells(
    style: ExemplarAnalysis,
    wall: FacadeWall,
    stack: list[WallFloor],
    source: Int32Array,
    down: Float64Array,
    across: Float64Array,
    plain: int,
    blank: bool,
) -> None:
    """Replace, in place, bays that do not fit into the free part, and crowns of walls without one.

    Parameters
    ----------
    source : (2, M, N) rows and columns of the exemplar's lattice.
    down : (M + 1,) borders of rows, metres.
    across : (N + 1,) borders of columns, metres.
    """
    exemplar, bare = style.structure, len(style.grid.columns)
    free = wall.free.buffer(0.02)
    shapely.prepare(free)
    for wall_floor, rows in zip(stack, floor_rows(stack), strict=True):
        row, count = rows.start, len(wall_floor.heights)
        own = 3 * plain + np.arange(count) if count == 3 else np.array([3 * plain + 1])
        if wall_floor.exemplar_floor == 0 and not wall_floor.is_crowned and exemplar.kinds[0] == "middle":
            source[0, row] = 3 * plain
        if blank:
            if (
                wall_floor.exemplar_floor < 0 or exemplar.kinds[wall_floor.exemplar_floor] == "ground"
            ) and not _is_mostly_wall(style, source[0, rows, 0], plain):
                source[0, rows, 0] = own
        else:
            low, high = (down[row + 1], down[row + 2]) if count == 3 else (down[row] + 0.1, down[row + 1] - 0.1)
            for left in range(0, source.shape[2], 3):
                first, last = across[left + 1 : left + 3].tolist()
                bent = any(first < seam < last for seam in wall.seams)
                first, last = first - BAYS.window_margin_m, last + BAYS.window_margin_m
                if bent or not free.covers(shapely.box(max(first, 0.0), low, min(last, wall.width), high)):
                    source[0, rows, left : left + 3] = own[:, None]
                    source[1, rows, left : left + 3] = bare


def blank_bays_at_door(
    source: Int32Array, across: Float64Array, middle: float, bands: int, plain: int, bare: int
) -> None:
    """Replace the bays of the lowest floor at a back door by bare wall; `source` as in `blank_cells`, of its rows."""
    half = ENTRANCES.door_size_m[0]
    door_columns = np.flatnonzero((across[:-1] < middle + half) & (across[1:] > middle - half))
    own = 3 * plain + np.arange(3) if bands == 3 else np.array([3 * plain + 1])
    for left in np.unique(door_columns // 3 * 3).tolist():
        source[0, :, left : left + 3] = own[:, None]
        source[1, :, left : left + 3] = bare


@lru_cache(maxsize=4)
def bare_columns(style: ExemplarAnalysis, plain: int) -> tuple[int, int]:
    """Return the pixel columns (start, stop) of uniform bare wall on the plainest floor."""
    rows = style.grid.rows[3 * plain : 3 * plain + 4]
    colours = [style.image[a:b].mean(axis=(0, 2)) for a, b in pairwise(rows)]
    floor = slice(rows[0], rows[-1])
    is_wall = style.labels[floor] == FacadeClass.WALL
    usual = float(lit_colour(style.image[floor][is_wall]).mean()) if is_wall.any() else 0.0
    wall = is_wall.mean(axis=0)
    best, found = -np.inf, (0, len(wall))
    bay = float(np.diff(style.structure.bay_cuts).mean())
    for width in sorted({min(len(wall), max(2, round(share * bay))) for share in BAYS.bare_width_shares}):
        uneven = np.max(
            [
                np.ptp(shown := sliding_window_view(colour, width), axis=1) + abs(shown.mean(axis=1) - usual)
                for colour in colours
            ],
            axis=0,
        )
        walled = sliding_window_view(wall, width).mean(axis=1)
        worth = width * walled**8 / (BAYS.negligible_unevenness + uneven)
        if worth.max() > best:
            best, left = float(worth.max()), int(np.argmax(worth))
            found = left, left + width
    return found


def _is_mostly_wall(style: ExemplarAnalysis, rows: IntArray, plain: int, least: float = BAYS.min_wall_share) -> bool:
    """Return whether lattice rows (k,) show mostly wall in the bare columns."""
    left, right = bare_columns(style, plain)
    shown = [
        style.labels[style.grid.rows[row] : style.grid.rows[row + 1], left:right] == FacadeClass.WALL
        for row in rows.tolist()
    ]
    return float(np.mean([part.mean() for part in shown])) > least
