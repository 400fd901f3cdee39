"""Skylight and reflected light on charts: paths of up to two reflections, traced on a grid and denoised.

Each place of the grid sends `rays_per_place` rays. A ray that hits a surface goes on once, and to the sun if there is one.
Directions depend on the place in the world only, so that neither workers nor the cut into charts change the light.

References
----------
Kajiya 1986, The rendering equation. Cranley & Patterson 1976, Randomization of number theoretic methods for multiple
integration.
"""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Float32Array, Float64Array
from facade_core.core.hash_uniform import COLUMN_FACTOR, ROW_FACTOR, SEED_FACTOR, hash_to_uniform
from facade_core.core.numba_cache import njit
from facade_core.core.types import Sun
from facade_core.geometry.daylight import fill_daylight_inside_buildings
from facade_core.geometry.raycast import MISS
from facade_core.geometry.scene import Scene
from facade_core.geometry.settings import DAYLIGHT
from facade_core.street.lighting.settings import AMBIENT, SUNLIGHT
from facade_core.street.lighting.sun import SUN_LIGHT, sky_light, sun_direction
from facade_core.street.materials.settings import MATERIAL_FIELD

# Nothing farther than this from a chart changes its skylight or the skylight that it gets by reflection.
AMBIENT_REACH_M = 2 * AMBIENT.occluder_range_m


def ambient_light(scene: Scene, chart: int, reflectance: Float64Array, sun: Sun | None) -> Float32Array:
    """Compute a grid of skylight and reflected light over a chart.

    Parameters
    ----------
    scene : the block's geometry.
    chart : row of the chart.
    reflectance : (charts, 3) shares of light that charts reflect.
    sun : None under an overcast sky.

    Returns
    -------
    (rows, columns, 3) float32 linear light from border to border; 1 in the open, level and under an overcast sky.
    """
    charts = scene.charts
    columns, rows = (
        np.maximum(np.ceil(charts.size[chart] / AMBIENT.ambient_cell_m - 1e-6), 1).astype(int) + 1
    ).tolist()
    width, height = charts.size[chart].tolist()
    inset = np.minimum(DAYLIGHT.ray_lift_m, 0.5 * charts.size[chart])
    across = np.clip(np.linspace(0, width, columns) + DAYLIGHT.ray_shift_m, inset[0], width - inset[0])
    down = np.clip(np.linspace(0, height, rows) + DAYLIGHT.ray_shift_m, inset[1], height - inset[1])
    normal = charts.normals()[chart]
    points = charts.points(chart, across[None, :], down[:, None]).reshape(-1, 3) + DAYLIGHT.ray_lift_m * normal
    light, behind = np.empty((len(points), 3)), np.empty(len(points))
    for first in range(0, len(points), AMBIENT.places_per_batch):
        batch = slice(first, first + AMBIENT.places_per_batch)
        light[batch], behind[batch] = _trace_places(scene, points[batch], normal, reflectance, sun)
    hidden = behind > DAYLIGHT.max_back_face_share
    grid = np.zeros(1, np.int64), np.array([rows]), np.array([columns])
    for band in range(3):
        filled = light[:, band].copy()
        fill_daylight_inside_buildings(filled, hidden, *grid)
        light[:, band] = filled
    traced = light.reshape(rows, columns, 3).astype(np.float32)
    return _denoise(traced, AMBIENT.noise / float(np.sqrt(AMBIENT.rays_per_place)), AMBIENT.denoising_rounds)


def _trace_places(
    scene: Scene, points: Float64Array, normal: Float64Array, reflectance: Float64Array, sun: Sun | None
) -> tuple[Float64Array, Float64Array]:
    """Return the light (p, 3) of places (p, 3) on a surface, and the share (p,) of their rays that hit back faces."""
    normals, sky = scene.charts.normals(), sky_light(sun)
    shape = (len(points), AMBIENT.rays_per_place)
    ahead = np.empty((*shape, 3), np.float32)
    _first_directions(points, normal, ahead)
    origins = np.broadcast_to(points[:, None], ahead.shape)
    depth, hit = scene.caster.cast(origins, ahead)
    is_hit = (depth <= AMBIENT.occluder_range_m) & (hit != MISS)
    light = _far_light(ahead, sky) * ~is_hit[..., None]
    struck, met = np.flatnonzero(is_hit), hit[is_hit]
    facing = normals[met]
    is_front = np.einsum("ij,ij->i", facing, ahead[is_hit]) < 0
    struck, met, facing = struck[is_front], met[is_front], facing[is_front]
    places = (origins.reshape(-1, 3)[struck] + depth.reshape(-1)[struck, None] * ahead.reshape(-1, 3)[struck]) + (
        SUNLIGHT.ray_lift_m * facing
    )
    received = _second_light(scene, places, facing, reflectance, sky)
    if sun is not None:
        towards = sun_direction(sun)
        cosine = np.maximum((facing * towards).sum(axis=1), 0.0)
        turned = np.flatnonzero(cosine > 0)
        distance, _ = scene.caster.cast(places[turned], np.broadcast_to(towards, (len(turned), 3)))
        cosine[turned[distance <= SUNLIGHT.max_shadow_reach_m - AMBIENT.occluder_range_m]] = 0
        received += cosine[:, None] * SUN_LIGHT
    light.reshape(-1, 3)[struck] = reflectance[met] * received
    behind = is_hit.sum(axis=1) - np.bincount(struck // shape[1], minlength=shape[0])
    return light.mean(axis=1), behind / shape[1]


def _second_light(
    scene: Scene, places: Float64Array, facing: Float64Array, reflectance: Float64Array, sky: Float64Array
) -> Float64Array:
    """Estimate the skylight (n, 3) that places (n, 3) with normals (n, 3) receive by one ray each."""
    ahead = np.empty(places.shape, np.float32)
    _next_directions(places, facing, ahead)
    depth, hit = scene.caster.cast(places, ahead)
    is_hit = (depth <= AMBIENT.occluder_range_m) & (hit != MISS)
    light = _far_light(ahead, sky)
    light[is_hit] = reflectance[hit[is_hit]] * AMBIENT.last_light * sky
    return light


def _far_light(ahead: Float32Array, sky: Float64Array) -> Float64Array:
    """Return the light (..., 3) that rays without a hit in directions (..., 3) bring: of the sky, or of open ground."""
    return np.where(ahead[..., 2:] >= 0, sky, MATERIAL_FIELD.ground_albedo * sky)


@njit(cache=True, inline="always")
def _place_hash(x: float, y: float, z: float) -> np.uint64:
    """Return the hash of a place, to the millimetre."""
    return (
        np.uint64(np.int64(np.floor(1000 * x))) * COLUMN_FACTOR
        + np.uint64(np.int64(np.floor(1000 * y))) * ROW_FACTOR
        + np.uint64(np.int64(np.floor(1000 * z))) * SEED_FACTOR
    )


@njit(cache=True, inline="always")
def _write_direction(share: float, turn: float, normal: Float64Array, out: Float32Array) -> None:
    """Write the direction of cosine density about a normal (3,), by two numbers in 0..1, to `out` (3,)."""
    radius, angle, up = np.sqrt(share), 2 * np.pi * turn, np.sqrt(1 - share)
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    # frame about the normal (Duff et al. 2017)
    sign = 1.0 if normal[2] >= 0 else -1.0
    a = -1.0 / (sign + normal[2])
    b = normal[0] * normal[1] * a
    out[0] = x * (1 + sign * normal[0] * normal[0] * a) + y * b + up * normal[0]
    out[1] = x * sign * b + y * (sign + normal[1] * normal[1] * a) + up * normal[1]
    out[2] = -x * sign * normal[0] - y * normal[1] + up * normal[2]


@njit(cache=True, nogil=True)
def _first_directions(points: Float64Array, normal: Float64Array, out: Float32Array) -> None:
    """Write the directions (p, r, 3) of places (p, 3): a spiral of equal shares, turned by the place."""
    count, golden = out.shape[1], (np.sqrt(5.0) - 1) / 2
    for k in range(len(points)):
        key = _place_hash(points[k, 0], points[k, 1], points[k, 2])
        turn, shift = hash_to_uniform(key), hash_to_uniform(key + COLUMN_FACTOR)
        for ray in range(count):
            _write_direction((ray + shift) / count, (turn + ray * golden) % 1.0, normal, out[k, ray])


@njit(cache=True, nogil=True)
def _next_directions(points: Float64Array, normals: Float64Array, out: Float32Array) -> None:
    """Write one direction (n, 3) of each place (n, 3) about its normal (n, 3)."""
    for k in range(len(points)):
        key = _place_hash(points[k, 0], points[k, 1], points[k, 2])
        _write_direction(hash_to_uniform(key), hash_to_uniform(key + COLUMN_FACTOR), normals[k], out[k])


@njit(cache=True, nogil=True)
def _denoise(light: Float32Array, noise: float, rounds: int) -> Float32Array:
    """Smooth a grid (rows, columns, 3) where neighbours differ by no more than its noise explains (bilateral filter)."""
    rows, columns = light.shape[0], light.shape[1]
    for _ in range(rounds):
        smooth = np.empty_like(light)
        for row in range(rows):
            for column in range(columns):
                red, green, blue, total = 0.0, 0.0, 0.0, 0.0
                own = light[row, column, 1]
                for r in range(max(row - 1, 0), min(row + 2, rows)):
                    for c in range(max(column - 1, 0), min(column + 2, columns)):
                        step = (light[r, c, 1] - own) / noise
                        weight = (2 - abs(r - row)) * (2 - abs(c - column)) / (1 + step * step)
                        red += weight * light[r, c, 0]
                        green += weight * light[r, c, 1]
                        blue += weight * light[r, c, 2]
                        total += weight
                smooth[row, column, 0] = red / total
                smooth[row, column, 1] = green / total
                smooth[row, column, 2] = blue / total
        light = smooth
    return light
