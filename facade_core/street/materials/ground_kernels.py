"""The kernel of the ground: surfaces, kerbs and marks by their shares of the footprint."""

from __future__ import annotations

import numpy as np

from facade_core.core.hash_uniform import COLUMN_FACTOR, SEED_FACTOR, hash_to_uniform, hash_row
from facade_core.core.numba_cache import njit
from facade_core.geometry.ground.layers import PATHS, PAVEMENT, ROAD
from facade_core.geometry.ground.shapes import CELL_M, CELLS, REACH_M, Drawn
from facade_core.street.materials.grain import GrainTables
from facade_core.street.materials.procedural import (
    SURFACE_COLOURS,
    SURFACE_GRAINS,
    GRASS,
    GRAVEL,
    LEAVES,
    MEAN_TONES,
    SETTS,
    SLABS,
    TAR,
    TRACK,
    WATER,
    ground_tone,
)

# A kerb's width and grey, the gutter's width and what it takes of its tone.
KERB_M, KERB_GREY, GUTTER_M, GUTTER_LOSS = 0.18, 164.0, 0.3, 0.12
# The tones of marks, and how much of what is under them they hide.
MARK_TONES = np.array([70.0, 62.0, 58.0, 168.0, 214.0])
MARK_COVERAGE = np.array([0.45, 0.7, 0.9, 0.9, 0.85])
# Leaves lie within this of a kerb, one in a cell at most, in such a share of cells where they have gathered, which chance says
# in squares of so many cells; a leaf's longest side.
LEAF_REACH_M, LEAF_CELL_M, MAX_LEAF_SHARE, LEAF_PATCH_CELLS, LEAF_LENGTH_M = 0.5, 0.1, 0.22, 24, 0.07
# What takes a whole `Drawn` is inlined: counting the references of its arrays at every call takes a third of the time.
# Where a wheel runs from its lane's middle.
WHEEL_OFFSET_M = 0.85


@njit(cache=True)
def to_byte(value: float) -> np.uint8:
    """A tone as a byte."""
    return np.uint8(np.int64(min(max(value, 0.0), 255.0) + 0.5))


@njit(cache=True, error_model="numpy")
def _overlap_share(low: float, high: float, middle: float, wide: float) -> float:
    """Of a piece `wide` about a place the share between low and high."""
    return max(min(middle + 0.5 * wide, high) - max(middle - 0.5 * wide, low), 0.0) / wide


@njit(cache=True, error_model="numpy")
def signed_distance(px: float, py: float, edges: np.ndarray, first: int, last: int) -> float:
    """How far a place lies outside of what is on the left of the nearest of some edges, metres, negative inside."""
    best, beside, sign = np.inf, -1.0, 1.0
    for k in range(first, last):
        qx, qy = px - edges[k, 0], py - edges[k, 1]
        past = qx * edges[k, 2] + qy * edges[k, 3]
        past -= min(max(past, 0.0), edges[k, 4])
        left = edges[k, 2] * qy - edges[k, 3] * qx
        away = past * past + left * left
        # of two edges with one corner nearest that counts which the place lies more beside
        if away < best - 1e-9 or (away < best + 1e-9 and abs(left) > beside):
            best, beside, sign = min(away, best), abs(left), -1.0 if left > 0 else 1.0
    return sign * np.sqrt(best)


@njit(cache=True, nogil=True, error_model="numpy")
def ground_colour(
    square: int,
    x: np.ndarray,
    y: np.ndarray,
    side: np.ndarray,
    drawn: Drawn,
    grains: GrainTables,
    seed: int,
    light: np.ndarray,
    grey: float,
    out: np.ndarray,
) -> None:
    """Colours (n, 3) of places on a square, each the mean of what its footprint covers."""
    n = len(x)
    weight = np.zeros((n, len(SURFACE_COLOURS)))
    along, across, aside = np.empty(n), np.empty(n), np.empty(n)
    over, hidden, frame = np.zeros(n), np.zeros(n), np.zeros(5)
    low_x, low_y = drawn.low[square, 0], drawn.low[square, 1]
    before, plain, made = -1, False, GRAVEL
    for k in range(n):
        column = min(max(int((x[k] - low_x) * (1 / CELL_M)), 0), CELLS - 1)
        row = min(max(int((y[k] - low_y) * (1 / CELL_M)), 0), CELLS - 1)
        cell = (square * CELLS + row) * CELLS + column
        if cell != before:
            before = cell
            made = _uniform_surface(cell, drawn)
            plain = made >= 0
        if plain and (made in (GRAVEL, GRASS, WATER)):
            weight[k, made] = 1.0
            continue
        nearest = _road_frame(cell, x[k], y[k], drawn, k, along, across, aside, frame)
        if plain:
            weight[k, made] = 1.0
        else:
            _add_layers(cell, x[k], y[k], min(side[k], 2 * REACH_M), nearest, drawn, seed, k, weight[k], over, hidden)
    total = np.zeros((3, n))
    member, px, py, ps, pa, tone = (
        np.empty(n, np.int64),
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty(n),
    )
    for made in range(len(SURFACE_COLOURS)):
        count, framed = 0, made in (SLABS, SETTS)
        for k in range(n):
            if weight[k, made] > 1e-3:
                member[count] = k
                px[count], py[count] = (along[k], across[k]) if framed else (x[k], y[k])
                ps[count], pa[count] = side[k], aside[k] if made == TAR else 9.0
                count += 1
        if count == 0:
            continue
        which, own = SURFACE_GRAINS[made], SURFACE_COLOURS[made].copy()
        if which >= 0 and made != TRACK and not np.isnan(grains.colour[which, 0]):
            for band in range(3):
                own[band] = grains.colour[which, band] / MEAN_TONES[made]
        ground_tone(made, px[:count], py[:count], pa[:count], ps[:count], grains, seed, tone[:count])
        for i in range(count):
            k = member[i]
            for band in range(3):
                total[band, k] += weight[k, made] * tone[i] * own[band]
    for k in range(n):
        for band in range(3):
            out[k, band] = to_byte((total[band, k] * (1 - hidden[k]) + over[k]) * grey * light[k])


@njit(cache=True, nogil=True)
def _uniform_surface(cell: int, drawn: Drawn) -> int:
    """What a whole cell is made of; -1 where that is not one thing."""
    first, last = drawn.start_layer[cell], drawn.start_layer[cell + 1]
    if drawn.start_mark[cell + 1] > drawn.start_mark[cell]:
        return -1
    if first == last:
        return GRAVEL
    if last > first + 1 or drawn.first_edge[last] > drawn.first_edge[first]:
        return -1
    layer = drawn.layer[first]
    if layer < PAVEMENT:
        return layer
    if layer == PAVEMENT:
        return SLABS
    if layer < ROAD:
        return layer - PATHS
    start, end = drawn.start_frame[cell], drawn.start_frame[cell + 1]
    for f in range(start + 1, end):
        if drawn.frames[f, 6] != drawn.frames[start, 6]:
            return -1
    return int(drawn.frames[start, 6]) if end > start else TAR


@njit(cache=True, error_model="numpy", forceinline=True)
def _road_frame(
    cell: int,
    px: float,
    py: float,
    drawn: Drawn,
    k: int,
    along: np.ndarray,
    across: np.ndarray,
    aside: np.ndarray,
    kept: np.ndarray,
) -> int:
    """Where a place is in the frame of the nearest road, which is told, -1 for none: along it, across it, and how far from the
    middle of a lane as `asphalt` has it. kept (5,): what is worked out once for a frame."""
    frames = drawn.frames
    first, last = drawn.start_frame[cell], drawn.start_frame[cell + 1]
    nearest = first if last > first else -1
    if last > first + 1:
        best = np.inf
        for f in range(first, last):
            away = _line_distance(px, py, frames, f) - frames[f, 5]
            if away < best:
                best, nearest = away, f
    if nearest < 0:
        along[k], across[k], aside[k] = px, py, 9.0
        return nearest
    if kept[0] != nearest + 1:
        dx, dy = frames[nearest, 2], frames[nearest, 3]
        if dx < 0 or (dx == 0 and dy < 0):  # the same slabs whichever way it runs
            dx, dy = -dx, -dy
        kept[0], kept[1], kept[2] = nearest + 1, dx, dy
        kept[3] = frames[nearest, 1] * dx - frames[nearest, 0] * dy
    dx, dy = kept[1], kept[2]
    along[k], across[k] = px * dx + py * dy, py * dx - px * dy
    lane = frames[nearest, 8]
    turn = (across[k] - kept[3]) / lane
    aside[k] = 1.7 + abs(abs(turn - np.floor(turn) - 0.5) * lane - WHEEL_OFFSET_M)
    return nearest


@njit(cache=True, error_model="numpy", forceinline=True)
def _add_layers(
    cell: int,
    px: float,
    py: float,
    wide: float,
    nearest: int,
    drawn: Drawn,
    seed: int,
    k: int,
    weight: np.ndarray,
    over: np.ndarray,
    hidden: np.ndarray,
) -> None:
    """What lies at a place: surfaces by their share, and what is laid over."""
    weight[GRAVEL] = 1.0
    for e in range(drawn.start_layer[cell], drawn.start_layer[cell + 1]):
        layer = drawn.layer[e]
        start, end = drawn.first_edge[e], drawn.first_edge[e + 1]
        outside = -REACH_M if drawn.inside[e] else REACH_M
        if end > start:
            found = signed_distance(px, py, drawn.edges, start, end)
            if np.isfinite(found):
                outside = min(max(found, -REACH_M), REACH_M)
        share = min(max(0.5 - outside / wide, 0.0), 1.0)
        if share > 0:
            for made in range(len(weight)):
                weight[made] *= 1 - share
        if layer == ROAD:
            _add_carriageway(cell, px, py, wide, share, outside, drawn, nearest, k, weight, over, hidden)
            fallen = _leaf_share(px, py, wide, outside, seed)
            if fallen > 0:
                for made in range(len(weight)):
                    weight[made] *= 1 - fallen
                weight[LEAVES] += fallen
        elif share > 0:
            weight[layer if layer < PAVEMENT else SLABS if layer == PAVEMENT else layer - PATHS] += share
    for m in range(drawn.start_mark[cell], drawn.start_mark[cell + 1]):
        share = _mark_share(px, py, wide, drawn.marks, m)
        if share > 0:
            kind = int(drawn.marks[m, 6])
            share *= MARK_COVERAGE[kind]
            over[k] = over[k] * (1 - share) + share * MARK_TONES[kind]
            hidden[k] = hidden[k] * (1 - share) + share


@njit(cache=True, error_model="numpy", forceinline=True)
def _add_carriageway(
    cell: int,
    px: float,
    py: float,
    wide: float,
    share: float,
    outside: float,
    drawn: Drawn,
    nearest: int,
    k: int,
    weight: np.ndarray,
    over: np.ndarray,
    hidden: np.ndarray,
) -> None:
    """A carriageway of what its road is made of, the higher over the lower, its gutter and its kerb."""
    frames = drawn.frames
    if share > 0:
        left, rank = share, -1.0
        if nearest >= 0:
            rank = frames[nearest, 7]
        for f in range(drawn.start_frame[cell + 1] - 1, drawn.start_frame[cell] - 1, -1):  # the highest first
            if frames[f, 7] <= rank:
                break
            own = min(max(0.5 - (_line_distance(px, py, frames, f) - frames[f, 5]) / wide, 0.0), 1.0)
            if own > 0:
                weight[int(frames[f, 6])] += left * own
                left *= 1 - own
        weight[int(frames[nearest, 6]) if nearest >= 0 else TAR] += left
    if abs(outside) >= REACH_M:
        return
    gutter = _overlap_share(-GUTTER_M, 0.0, outside, wide) * GUTTER_LOSS
    lip = _overlap_share(-0.03, 0.0, outside, wide) * 0.5
    if gutter + lip > 0:
        for made in range(len(weight)):
            weight[made] *= 1 - gutter - lip
    stone = _overlap_share(0.0, KERB_M, outside, wide)
    if stone > 0:
        over[k] = over[k] * (1 - stone) + stone * KERB_GREY
        hidden[k] = hidden[k] * (1 - stone) + stone


@njit(cache=True, error_model="numpy")
def _leaf_share(px: float, py: float, wide: float, outside: float, seed: int) -> float:
    """The share of a footprint under fallen leaves, most of them by the kerb; outside: how far it is from there, metres."""
    near = 1 - abs(outside) / LEAF_REACH_M
    if near <= 0 or wide > 2 * LEAF_CELL_M:  # what covers many of them would show none
        return 0.0
    own, share = np.uint64(seed + 89) * SEED_FACTOR, 0.0
    left, right = int(np.floor((px - 0.5 * wide) / LEAF_CELL_M)), int(np.floor((px + 0.5 * wide) / LEAF_CELL_M))
    first, last = int(np.floor((py - 0.5 * wide) / LEAF_CELL_M)), int(np.floor((py + 0.5 * wide) / LEAF_CELL_M))
    for row in range(first, last + 1):
        for column in range(left, right + 1):
            gathered = hash_to_uniform(np.uint64(column // LEAF_PATCH_CELLS) * COLUMN_FACTOR + hash_row(row // LEAF_PATCH_CELLS, own + np.uint64(1)))
            h = np.uint64(column) * COLUMN_FACTOR + hash_row(row, own)
            if hash_to_uniform(h) > MAX_LEAF_SHARE * near * gathered * gathered:
                continue
            u, v, turn = hash_to_uniform(h + np.uint64(1)), hash_to_uniform(h + np.uint64(2)), hash_to_uniform(h + np.uint64(3))
            across, down = LEAF_LENGTH_M * (0.45 + 0.55 * turn), LEAF_LENGTH_M * (1.0 - 0.55 * turn)
            x0 = (column + u * (1 - across / LEAF_CELL_M)) * LEAF_CELL_M - px
            y0 = (row + v * (1 - down / LEAF_CELL_M)) * LEAF_CELL_M - py
            share += _overlap_share(x0, x0 + across, 0.0, wide) * _overlap_share(y0, y0 + down, 0.0, wide)
    return min(share, 1.0)


@njit(cache=True, error_model="numpy")
def _line_distance(px: float, py: float, frames: np.ndarray, f: int) -> float:
    """How far a place is from the line of a frame, metres."""
    qx, qy = px - frames[f, 0], py - frames[f, 1]
    past = qx * frames[f, 2] + qy * frames[f, 3]
    past -= min(max(past, 0.0), frames[f, 4])
    left = frames[f, 2] * qy - frames[f, 3] * qx
    return np.sqrt(past * past + left * left)


@njit(cache=True, error_model="numpy")
def _mark_share(px: float, py: float, wide: float, marks: np.ndarray, m: int) -> float:
    """The share of a footprint on a mark."""
    qx, qy, length, half = px - marks[m, 0], py - marks[m, 1], marks[m, 4], marks[m, 5]
    run, off = qx * marks[m, 2] + qy * marks[m, 3], qy * marks[m, 2] - qx * marks[m, 3]
    if marks[m, 7] > 0:
        past = run - min(max(run, 0.0), length)
        return min(max(0.5 - (np.sqrt(past * past + off * off) - half) / wide, 0.0), 1.0)
    return _overlap_share(-half, half, off, wide) * _overlap_share(0.0, length, run, wide)
