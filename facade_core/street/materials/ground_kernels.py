"""Kernel of the ground: surfaces, kerbs and marks by their share of the footprint."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Float64Array, UInt8Array
from facade_core.core.hash_uniform import COLUMN_FACTOR, SEED_FACTOR, hash_cell_row, hash_to_uniform
from facade_core.core.numba_cache import njit
from facade_core.geometry.ground.layers import FIRST_PATH_LAYER, PAVEMENT_LAYER, ROAD_LAYER
from facade_core.geometry.ground.shapes import CELLS_PER_SIDE, EDGE_REACH_M, LOOKUP_CELL_M, GroundTileArrays
from facade_core.street.materials.grain import GrainTables
from facade_core.street.materials.pictured_ground import PicturedGround, add_pictured_ground
from facade_core.street.materials.procedural import (
    MEAN_TONES,
    SURFACE_COLOURS,
    SURFACE_GRAINS,
    GroundSurface,
    ground_tone,
)
from facade_core.street.materials.settings import GROUND_KERNELS

# Surface by layer; that of the carriageways where no road states another.
LAYER_SURFACES = np.array(
    [*range(PAVEMENT_LAYER), GroundSurface.SLABS, *range(ROAD_LAYER - FIRST_PATH_LAYER), GroundSurface.ASPHALT]
)
# Tones of marks, and their opacity.
MARK_TONES = np.array([70.0, 62.0, 58.0, 168.0, 214.0])
MARK_COVERAGE = np.array([0.45, 0.7, 0.9, 0.9, 0.85])


@njit(cache=True)
def to_byte(value: float) -> np.uint8:
    """Round a tone to a byte."""
    return np.uint8(np.int64(min(max(value, 0.0), 255.0) + 0.5))


@njit(cache=True, error_model="numpy")
def _overlap_share(low: float, high: float, middle: float, wide: float) -> float:
    """Return the share of an interval of width `wide` about `middle` between low and high."""
    return max(min(middle + 0.5 * wide, high) - max(middle - 0.5 * wide, low), 0.0) / wide


@njit(cache=True, error_model="numpy")
def signed_distance(px: float, py: float, edges: Float64Array, first: int, last: int) -> float:
    """Compute the distance from the area left of the nearest edge, metres, negative inside.

    Parameters
    ----------
    px, py : point, metres.
    edges : (m, 5) start, direction and length of each edge.
    first, last : range of the edges.
    """
    best, lateral, sign = np.inf, -1.0, 1.0
    for k in range(first, last):
        qx, qy = px - edges[k, 0], py - edges[k, 1]
        along = qx * edges[k, 2] + qy * edges[k, 3]
        along -= min(max(along, 0.0), edges[k, 4])
        left = edges[k, 2] * qy - edges[k, 3] * qx
        squared = along * along + left * left
        # two edges share the nearest corner: take the one with the larger lateral distance
        if squared < best - 1e-9 or (squared < best + 1e-9 and abs(left) > lateral):
            best, lateral, sign = min(squared, best), abs(left), -1.0 if left > 0 else 1.0
    distance: float = sign * np.sqrt(best)
    return distance


@njit(cache=True, nogil=True, error_model="numpy")
def ground_colour(
    square: int,
    x: Float64Array,
    y: Float64Array,
    side: Float64Array,
    drawn: GroundTileArrays,
    grains: GrainTables,
    pictured: PicturedGround,
    seed: int,
    light: Float64Array,
    grey: float,
    out: UInt8Array,
) -> None:
    """Compute the colours of points on a ground square, averaged over footprints.

    Parameters
    ----------
    square : index of the square in `drawn`.
    x, y : (n,) world coordinates, metres.
    side : (n,) footprints, metres.
    drawn : ground shapes by square and cell.
    grains : tables of all grains.
    pictured : surfaces as pictures show them.
    seed : random seed.
    light : (n,) soft daylight.
    grey : brightness of white.
    out : (n, 3) uint8 output.
    """
    n = len(x)
    weight = np.zeros((n, len(SURFACE_COLOURS)))
    along, across, aside = np.empty(n), np.empty(n), np.empty(n)
    over, hidden, frame = np.zeros(n), np.zeros(n), np.zeros(5)
    low_x, low_y = drawn.tile_origin[square, 0], drawn.tile_origin[square, 1]
    last_cell, is_uniform, surface = -1, False, GroundSurface.GRAVEL.value
    for k in range(n):
        column = min(max(int((x[k] - low_x) * (1 / LOOKUP_CELL_M)), 0), CELLS_PER_SIDE - 1)
        row = min(max(int((y[k] - low_y) * (1 / LOOKUP_CELL_M)), 0), CELLS_PER_SIDE - 1)
        cell = (square * CELLS_PER_SIDE + row) * CELLS_PER_SIDE + column
        if cell != last_cell:
            last_cell = cell
            surface = _uniform_surface(cell, drawn)
            is_uniform = surface >= 0
        if is_uniform and (surface in (GroundSurface.GRAVEL, GroundSurface.GRASS, GroundSurface.WATER)):
            weight[k, surface] = 1.0
            continue
        nearest = _road_frame(cell, x[k], y[k], drawn, k, along, across, aside, frame)
        if is_uniform:
            weight[k, surface] = 1.0
        else:
            _add_layers(
                cell, x[k], y[k], min(side[k], 2 * EDGE_REACH_M), nearest, drawn, seed, k, weight[k], over, hidden
            )
    total = np.zeros((n, 3))
    member, px, py, ps, pa, tone = (
        np.empty(n, np.int64),
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty(n),
    )
    for surface in range(len(SURFACE_COLOURS)):
        which, tint = SURFACE_GRAINS[surface], SURFACE_COLOURS[surface].copy()
        is_stated = which >= 0 and surface != GroundSurface.TRACK and not np.isnan(grains.colour[which, 0])
        if pictured.start[surface + 1] > pictured.start[surface] and not is_stated:
            add_pictured_ground(surface, x, y, side, pictured, seed, weight[:, surface] / grey, total)
            continue
        count, in_frame = 0, surface in (GroundSurface.SLABS, GroundSurface.SETTS)
        for k in range(n):
            if weight[k, surface] > 1e-3:
                member[count] = k
                px[count], py[count] = (along[k], across[k]) if in_frame else (x[k], y[k])
                ps[count], pa[count] = side[k], aside[k] if surface == GroundSurface.ASPHALT else 9.0
                count += 1
        if count == 0:
            continue
        if is_stated:
            for band in range(3):
                tint[band] = grains.colour[which, band] / MEAN_TONES[surface]
        ground_tone(surface, px[:count], py[:count], pa[:count], ps[:count], grains, seed, tone[:count])
        for i in range(count):
            k = member[i]
            for band in range(3):
                total[k, band] += weight[k, surface] * tone[i] * tint[band]
    for k in range(n):
        for band in range(3):
            out[k, band] = to_byte((total[k, band] * (1 - hidden[k]) + over[k]) * grey * light[k])


@njit(cache=True, nogil=True)
def _uniform_surface(cell: int, drawn: GroundTileArrays) -> int:
    """Return the surface of a cell that has only one, else -1."""
    first, last = drawn.start_layer[cell], drawn.start_layer[cell + 1]
    if drawn.start_mark[cell + 1] > drawn.start_mark[cell]:
        return -1
    if first == last:
        return GroundSurface.GRAVEL.value
    if last > first + 1 or drawn.first_edge[last] > drawn.first_edge[first]:
        return -1
    layer = int(drawn.layer[first])
    if layer < ROAD_LAYER:
        return int(LAYER_SURFACES[layer])
    start, end = drawn.start_road[cell], drawn.start_road[cell + 1]
    for f in range(start + 1, end):
        if drawn.roads[f, 6] != drawn.roads[start, 6]:
            return -1
    return int(drawn.roads[start, 6]) if end > start else GroundSurface.ASPHALT.value


# What takes a whole `Drawn` is inlined: counting the references of its arrays at every call takes a third of the time.
@njit(cache=True, error_model="numpy", forceinline=True)
def _road_frame(
    cell: int,
    px: float,
    py: float,
    drawn: GroundTileArrays,
    k: int,
    along: Float64Array,
    across: Float64Array,
    aside: Float64Array,
    kept: Float64Array,
) -> int:
    """Compute a point's coordinates in the frame of the nearest road.

    Returns the road, -1 for none. Writes the coordinate along and across the road and the distance from the middle of a
    lane for `asphalt_tone`. kept (5,): cached values of one frame.
    """
    frames = drawn.roads
    first, last = drawn.start_road[cell], drawn.start_road[cell + 1]
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
        if dx < 0 or (dx == 0 and dy < 0):  # slabs do not depend on the road's direction
            dx, dy = -dx, -dy
        kept[0], kept[1], kept[2] = nearest + 1, dx, dy
        kept[3] = frames[nearest, 1] * dx - frames[nearest, 0] * dy
    dx, dy = kept[1], kept[2]
    along[k], across[k] = px * dx + py * dy, py * dx - px * dy
    lane = frames[nearest, 8]
    turn = (across[k] - kept[3]) / lane
    aside[k] = 1.7 + abs(abs(turn - np.floor(turn) - 0.5) * lane - GROUND_KERNELS.wheel_offset_m)
    return nearest


@njit(cache=True, error_model="numpy", forceinline=True)
def _add_layers(
    cell: int,
    px: float,
    py: float,
    wide: float,
    nearest: int,
    drawn: GroundTileArrays,
    seed: int,
    k: int,
    weight: Float64Array,
    over: Float64Array,
    hidden: Float64Array,
) -> None:
    """Add the surfaces at a point by their share, and marks over them."""
    weight[GroundSurface.GRAVEL] = 1.0
    for e in range(drawn.start_layer[cell], drawn.start_layer[cell + 1]):
        layer = drawn.layer[e]
        start, end = drawn.first_edge[e], drawn.first_edge[e + 1]
        outside = -EDGE_REACH_M if drawn.inside[e] else EDGE_REACH_M
        if end > start:
            distance = signed_distance(px, py, drawn.edges, start, end)
            if np.isfinite(distance):
                outside = min(max(distance, -EDGE_REACH_M), EDGE_REACH_M)
        share = min(max(0.5 - outside / wide, 0.0), 1.0)
        if share > 0:
            for surface in range(len(weight)):
                weight[surface] *= 1 - share
        if layer == ROAD_LAYER:
            _add_carriageway(cell, px, py, wide, share, outside, drawn, nearest, k, weight, over, hidden)
            fallen = _leaf_share(px, py, wide, outside, seed)
            if fallen > 0:
                for surface in range(len(weight)):
                    weight[surface] *= 1 - fallen
                weight[GroundSurface.LEAVES] += fallen
        elif share > 0:
            weight[LAYER_SURFACES[layer]] += share
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
    drawn: GroundTileArrays,
    nearest: int,
    k: int,
    weight: Float64Array,
    over: Float64Array,
    hidden: Float64Array,
) -> None:
    """Add the surfaces of a carriageway, higher roads over lower ones, with gutter and kerb."""
    frames = drawn.roads
    if share > 0:
        left, rank = share, -1.0
        if nearest >= 0:
            rank = frames[nearest, 7]
        for f in range(drawn.start_road[cell + 1] - 1, drawn.start_road[cell] - 1, -1):  # the highest first
            if frames[f, 7] <= rank:
                break
            covered = min(max(0.5 - (_line_distance(px, py, frames, f) - frames[f, 5]) / wide, 0.0), 1.0)
            if covered > 0:
                weight[int(frames[f, 6])] += left * covered
                left *= 1 - covered
        weight[int(frames[nearest, 6]) if nearest >= 0 else GroundSurface.ASPHALT.value] += left
    if abs(outside) >= EDGE_REACH_M:
        return
    gutter = _overlap_share(-GROUND_KERNELS.gutter_m, 0.0, outside, wide) * GROUND_KERNELS.gutter_loss
    lip = _overlap_share(-0.03, 0.0, outside, wide) * 0.5
    if gutter + lip > 0:
        for surface in range(len(weight)):
            weight[surface] *= 1 - gutter - lip
    stone = _overlap_share(0.0, GROUND_KERNELS.kerb_m, outside, wide)
    if stone > 0:
        over[k] = over[k] * (1 - stone) + stone * GROUND_KERNELS.kerb_grey
        hidden[k] = hidden[k] * (1 - stone) + stone


@njit(cache=True, error_model="numpy")
def _leaf_share(px: float, py: float, wide: float, outside: float, seed: int) -> float:
    """Return the share of a footprint under fallen leaves.

    outside: distance from the kerb, metres.
    """
    near = 1 - abs(outside) / GROUND_KERNELS.leaf_reach_m
    if near <= 0 or wide > 2 * GROUND_KERNELS.leaf_cell_m:  # a larger footprint would show no single leaf
        return 0.0
    row_seed, share = np.uint64(seed + 89) * SEED_FACTOR, 0.0
    left, right = (
        int(np.floor((px - 0.5 * wide) / GROUND_KERNELS.leaf_cell_m)),
        int(np.floor((px + 0.5 * wide) / GROUND_KERNELS.leaf_cell_m)),
    )
    first, last = (
        int(np.floor((py - 0.5 * wide) / GROUND_KERNELS.leaf_cell_m)),
        int(np.floor((py + 0.5 * wide) / GROUND_KERNELS.leaf_cell_m)),
    )
    for row in range(first, last + 1):
        for column in range(left, right + 1):
            density = hash_to_uniform(
                np.uint64(column // GROUND_KERNELS.leaf_patch_cells) * COLUMN_FACTOR
                + hash_cell_row(row // GROUND_KERNELS.leaf_patch_cells, row_seed + np.uint64(1))
            )
            h = np.uint64(column) * COLUMN_FACTOR + hash_cell_row(row, row_seed)
            if hash_to_uniform(h) > GROUND_KERNELS.max_leaf_share * near * density * density:
                continue
            u, v, turn = (
                hash_to_uniform(h + np.uint64(1)),
                hash_to_uniform(h + np.uint64(2)),
                hash_to_uniform(h + np.uint64(3)),
            )
            across, down = (
                GROUND_KERNELS.leaf_length_m * (0.45 + 0.55 * turn),
                GROUND_KERNELS.leaf_length_m * (1.0 - 0.55 * turn),
            )
            x0 = (column + u * (1 - across / GROUND_KERNELS.leaf_cell_m)) * GROUND_KERNELS.leaf_cell_m - px
            y0 = (row + v * (1 - down / GROUND_KERNELS.leaf_cell_m)) * GROUND_KERNELS.leaf_cell_m - py
            share += _overlap_share(x0, x0 + across, 0.0, wide) * _overlap_share(y0, y0 + down, 0.0, wide)
    return min(share, 1.0)


@njit(cache=True, error_model="numpy")
def _line_distance(px: float, py: float, frames: Float64Array, f: int) -> float:
    """Return the distance of a point from the line of a frame, metres."""
    qx, qy = px - frames[f, 0], py - frames[f, 1]
    past = qx * frames[f, 2] + qy * frames[f, 3]
    past -= min(max(past, 0.0), frames[f, 4])
    left = frames[f, 2] * qy - frames[f, 3] * qx
    distance: float = np.sqrt(past * past + left * left)
    return distance


@njit(cache=True, error_model="numpy")
def _mark_share(px: float, py: float, wide: float, marks: Float64Array, m: int) -> float:
    """Return the share of a footprint on a mark."""
    qx, qy, length, half = px - marks[m, 0], py - marks[m, 1], marks[m, 4], marks[m, 5]
    run, off = qx * marks[m, 2] + qy * marks[m, 3], qy * marks[m, 2] - qx * marks[m, 3]
    if marks[m, 7] > 0:
        past = run - min(max(run, 0.0), length)
        round_share: float = min(max(0.5 - (np.sqrt(past * past + off * off) - half) / wide, 0.0), 1.0)
        return round_share
    share: float = _overlap_share(-half, half, off, wide) * _overlap_share(0.0, length, run, wide)
    return share
