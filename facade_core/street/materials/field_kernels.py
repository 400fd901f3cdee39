"""Kernels of the material field: tones by chart, lit, as bytes.

Points are processed in batches of one chart, one pass per ingredient. Every caller uses the same passes.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import Float64Array, Int64Array, UInt8Array
from facade_core.core.hash_uniform import hash_uniform
from facade_core.core.numba_cache import njit
from facade_core.geometry.daylight import MIN_DAYLIGHT
from facade_core.geometry.ground.shapes import GroundTileArrays
from facade_core.street.materials.grain import GrainTables, add_grain
from facade_core.street.materials.ground_kernels import ground_colour, to_byte
from facade_core.street.materials.pictured_ground import PicturedGround
from facade_core.street.materials.procedural import (
    FLASHING_COLOUR,
    FRAME_COLOUR,
    GLASS_COLOUR,
    MORTAR_COLOUR,
    REFLECTED_SKY_COLOUR,
    add_rain_weathering,
    brick_tone,
    door_boards_tone,
    frame_share,
    glass_reflection,
    metal_fixture_colour,
    plaster_tone,
    soffit_tone,
)
from facade_core.street.materials.roofs import (
    MOSS_COLOUR,
    felt_tone,
    moss_share,
    roof_gravel_tone,
    roof_tile_tone,
    sheet_metal_tone,
    slate_tone,
)
from facade_core.street.materials.settings import FIELD_KERNELS
from facade_core.street.materials.tiled_material import MipLevels, sample_mip_levels
from facade_core.street.propagation.sampling import DaylightGrids, interpolate_light


class SurfaceMaterial(IntEnum):
    """Procedural materials of charts."""

    GROUND = 0
    SHEET_METAL = 1
    ROOF_TILE = 2
    ROOF_PICTURE = 3
    PLASTER = 4
    GLASS = 5
    BOARDS = 6
    SOFFIT = 7
    BRICK = 8
    SLATE = 9
    FELT = 10
    ROOF_GRAVEL = 11
    METAL_FIXTURE = 12


class ChartMaterials(NamedTuple):
    """Materials and frames of all n charts as the kernels read them.

    Attributes
    ----------
    origin, axis_u, axis_v : (n, 3) frames, as in `Charts`.
    size : (n, 2) metres.
    plane_offset : (n, 2) offset from a chart's coordinates to those of its plane, metres.
    material : (n,) uint8 `SurfaceMaterial`.
    tint : (n, 3) shaded colour of the building.
    grey : (n,) brightness of white under soft daylight.
    wall_foot_z : (n,) height at which the building's walls begin, metres.
    open_sky : (n,) light without occluders, 0..1.
    grain : (n,) `GrainKind`.
    moss_share : (n,) share of moss at the worst place.
    """

    origin: Float64Array
    axis_u: Float64Array
    axis_v: Float64Array
    size: Float64Array
    plane_offset: Float64Array
    material: UInt8Array
    tint: Float64Array
    grey: Float64Array
    wall_foot_z: Float64Array
    open_sky: Float64Array
    grain: Int64Array
    moss_share: Float64Array


class MaterialOverride(NamedTuple):
    """Material that replaces the own one of some charts.

    Attributes
    ----------
    charts : (k,) int64 chart rows, ascending.
    material : `SurfaceMaterial`.
    grain : `GrainKind`.
    colour : (3,) in a light of 1.
    """

    charts: Int64Array
    material: int
    grain: int
    colour: Float64Array


NO_OVERRIDE = MaterialOverride(np.zeros(0, np.int64), 0, 0, np.zeros(3))


class MaterialFieldArrays(NamedTuple):
    """Inputs of the material field's kernels, except the light.

    Attributes
    ----------
    charts : materials of all charts.
    override : material that replaces the own one of some charts.
    ground : ground of at least the asked charts.
    roof : picture of the roof material.
    grains : grain examples.
    pictured : ground as pictures show it.
    seed : seed of all random draws.
    """

    charts: ChartMaterials
    override: MaterialOverride
    ground: GroundTileArrays
    roof: MipLevels
    grains: GrainTables
    pictured: PicturedGround
    seed: int


@njit(cache=True, nogil=True, error_model="numpy")
def compute_point_colours(
    order: Int64Array,
    chart: Int64Array,
    places: Float64Array,
    footprint: Float64Array,
    field: MaterialFieldArrays,
    lights: DaylightGrids,
    out: UInt8Array,
) -> None:
    """Compute the colours of points, into `out`.

    Parameters
    ----------
    order : (n,) permutation that groups points by chart.
    chart : (n,) chart rows.
    places : (n, 3) world points, metres.
    footprint : (n,) metres.
    field : inputs of the field.
    lights : soft daylight.
    out : (n, 3) uint8.
    """
    points, side, batch = (
        np.empty((3, FIELD_KERNELS.batch_points)),
        np.empty(FIELD_KERNELS.batch_points),
        np.empty((FIELD_KERNELS.batch_points, 3), np.uint8),
    )
    start = 0
    while start < len(order):
        current, count = chart[order[start]], 0
        while (
            count < FIELD_KERNELS.batch_points and start + count < len(order) and chart[order[start + count]] == current
        ):
            k = order[start + count]
            for axis in range(3):
                points[axis, count] = places[k, axis]
            side[count] = footprint[k]
            count += 1
        _colour_batch(current, points[:, :count], side[:count], field, lights, batch[:count])
        for k in range(count):
            for band in range(3):
                out[order[start + k], band] = batch[k, band]
        start += count


@njit(cache=True)
def _lower_bound(numbers: Int64Array, number: int) -> int:
    """Return the index of the first of ascending numbers not below `number`.

    Compiles faster than numba's search.
    """
    low, high = 0, len(numbers)
    while low < high:
        middle = (low + high) // 2
        if numbers[middle] < number:
            low = middle + 1
        else:
            high = middle
    return low


@njit(cache=True, inline="always", error_model="numpy")
def _surface_tone(
    c: int,
    material: int,
    points: Float64Array,
    side: Float64Array,
    charts: ChartMaterials,
    seed: int,
    work: Float64Array,
) -> tuple[Float64Array, Float64Array, float]:
    """Compute the tone of a chart's material at points (3, n), without grain.

    Parameters
    ----------
    work : (7, n) as of `_colour_batch`; the tone is written to its third row, the share of a second colour to its fifth.

    Returns
    -------
    x, y : (n,) positions of the grain.
    share : share of the second colour on the chart, 0 for none.
    """
    x, y, tone, other, east, north = work[0], work[1], work[2], work[4], work[5], work[6]
    axis_v, size, start = charts.axis_v[c], charts.size[c], charts.plane_offset[c]
    n, share = len(side), 0.0
    if material in (SurfaceMaterial.SHEET_METAL, SurfaceMaterial.FELT, SurfaceMaterial.ROOF_GRAVEL):
        if abs(axis_v[2]) < FIELD_KERNELS.min_roof_fall:
            x, y = east, north
        if material == SurfaceMaterial.SHEET_METAL:
            sheet_metal_tone(x, y, side, seed, tone)
        elif material == SurfaceMaterial.ROOF_GRAVEL:
            roof_gravel_tone(x, y, side, seed, tone)
        else:
            felt_tone(x, y, side, seed, tone)
    elif material in (SurfaceMaterial.ROOF_TILE, SurfaceMaterial.SLATE):
        if material == SurfaceMaterial.ROOF_TILE:
            roof_tile_tone(x, y, side, seed, tone)
        else:
            slate_tone(x, y, side, seed, tone)
        if charts.moss_share[c] > 0:
            share = charts.moss_share[c]
            moss_share(x, y, side, share, seed, other)
    elif material in (SurfaceMaterial.PLASTER, SurfaceMaterial.BRICK):
        for k in range(n):
            north[k] = points[2, k] - charts.wall_foot_z[c]
        if material == SurfaceMaterial.PLASTER:
            plaster_tone(x, y, north, side, seed, tone)
        else:
            share = 1.0
            brick_tone(x, y, north, side, seed, other, tone)
        for k in range(n):
            east[k] = y[k] - start[1]
        add_rain_weathering(x, y, north, east, side, seed, tone)
    elif material == SurfaceMaterial.BOARDS:
        door_boards_tone(x, y, side, seed, tone)
        x, y = y, x  # the example has horizontal boards
    elif material == SurfaceMaterial.METAL_FIXTURE:
        for k in range(n):
            east[k], north[k] = x[k] - start[0], y[k] - start[1]
        metal_fixture_colour(x, y, east, north, size[0], size[1], side, seed, tone)
    else:
        soffit_tone(x, y, side, seed, tone)
    return x, y, share


@njit(cache=True, inline="always", error_model="numpy")
def _colour_batch(
    c: int, points: Float64Array, side: Float64Array, field: MaterialFieldArrays, lights: DaylightGrids, out: UInt8Array
) -> None:
    """Compute colours (n, 3) of points (3, n) of one chart.

    All callers come here, so that a point has one colour.
    """
    charts, seed = field.charts, field.seed
    n = len(side)
    work = np.empty((7, n))
    x, y, tone, light, other, east, north = work[0], work[1], work[2], work[3], work[4], work[5], work[6]
    origin, axis_u, axis_v, size = charts.origin[c], charts.axis_u[c], charts.axis_v[c], charts.size[c]
    start = charts.plane_offset[c]
    place, columns, rows, grid, roof = lights.place[c], lights.columns[c], lights.rows[c], lights.light, field.roof
    for k in range(n):
        right, down, off = points[0, k] - origin[0], points[1, k] - origin[1], points[2, k] - origin[2]
        x[k] = right * axis_u[0] + down * axis_u[1] + off * axis_u[2]
        y[k] = right * axis_v[0] + down * axis_v[1] + off * axis_v[2]
    for k in range(n):
        clear = (interpolate_light(x[k] / size[0], y[k] / size[1], place, columns, rows, grid) - MIN_DAYLIGHT) / (
            1 - MIN_DAYLIGHT
        )
        light[k] = 1 - FIELD_KERNELS.occlusion_loss * max(1 - clear / charts.open_sky[c], 0.0)
    for k in range(n):
        x[k], y[k] = x[k] + start[0], y[k] + start[1]
        east[k], north[k] = points[0, k], points[1, k]
    material, grey, example = int(charts.material[c]), charts.grey[c], charts.grain[c]
    tint, override = charts.tint[c], _lower_bound(field.override.charts, c)
    if override < len(field.override.charts) and field.override.charts[override] == c:
        material, example, tint = field.override.material, field.override.grain, field.override.colour * grey
    if material == SurfaceMaterial.GROUND:
        ground_colour(
            field.ground.chart_tile[c],
            east,
            north,
            side,
            field.ground,
            field.grains,
            field.pictured,
            seed,
            light,
            grey,
            out,
        )
        return
    if material == SurfaceMaterial.ROOF_PICTURE:
        for k in range(n):
            laid = sample_mip_levels(roof, x[k], y[k], side[k])
            for band in range(3):
                out[k, band] = to_byte(laid[band] * grey * light[k])
        return
    if material == SurfaceMaterial.GLASS:
        glass_reflection(x, y, size[1], side, seed, tone)
        frame_share(x, y, size[0], size[1], side, other)
        frame = FLASHING_COLOUR if axis_v[2] > FIELD_KERNELS.roof_pane_axis_z else FRAME_COLOUR
        for k in range(n):
            for band in range(3):
                pane = GLASS_COLOUR[band] + tone[k] * (REFLECTED_SKY_COLOUR[band] - GLASS_COLOUR[band])
                out[k, band] = to_byte((pane + other[k] * (frame[band] - pane)) * grey * light[k])
        return
    x, y, share = _surface_tone(c, material, points, side, field.charts, seed, work)
    mixed = MOSS_COLOUR if material in (SurfaceMaterial.ROOF_TILE, SurfaceMaterial.SLATE) else MORTAR_COLOUR
    add_grain(x, y, side, field.grains, example, 1.0, seed + 71, tone)
    if share > 0:
        for k in range(n):
            for band in range(3):
                mean = tint[band] + other[k] * (mixed[band] * grey - tint[band])
                out[k, band] = to_byte(tone[k] * mean * light[k])
        return
    for k in range(n):
        for band in range(3):
            out[k, band] = to_byte(tone[k] * tint[band] * light[k])


@njit(cache=True)
def pick_palette_colours(palette: Float64Array, number: Int64Array, seed: int) -> Float64Array:
    """Pick a random colour of a palette for each number.

    Parameters
    ----------
    palette : (k, 3) colours.
    number : (n,) numbers to hash.
    seed : random seed.

    Returns
    -------
    (n, 3).
    """
    out = np.empty((len(number), 3))
    for i in range(len(number)):
        row = int(hash_uniform(number[i], seed) * len(palette))
        for band in range(3):
            out[i, band] = palette[row, band]
    return out


@njit(cache=True)
def hash_uniform_array(number: Int64Array, seed: int) -> Float64Array:
    """Hash each number (n,) to a uniform number in 0..1."""
    out = np.empty(len(number))
    for i in range(len(number)):
        out[i] = hash_uniform(number[i], seed)
    return out
