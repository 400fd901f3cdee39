"""Ambient light of walls: visible sky and one bounce from surrounding surfaces."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array
from facade_core.core.fixed_order import multiply_matrices
from facade_core.core.types import Sun
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.daylight import fill_daylight_inside_buildings, hemisphere_directions
from facade_core.geometry.scene import Scene
from facade_core.geometry.settings import DAYLIGHT
from facade_core.street.lighting.settings import AMBIENT, SUNLIGHT
from facade_core.street.lighting.sun import SKY_LIGHT, SUN_LIGHT, sun_direction


def ambient_light(scene: Scene, chart: int, sun: Sun) -> tuple[Float32Array, Float32Array]:
    """Compute grids of skylight and of reflected sunlight over a chart.

    A ray that hits nothing within `occluder_range_m` brings the sky's light. A ray that hits a surface brings its
    reflected skylight, and its reflected sunlight if the sun reaches it. Nothing farther than MAX_SHADOW_REACH_M has an
    influence.

    Returns
    -------
    Both (rows, columns) float32, from border to border, relative to the skylight of most walls of a street.
    """
    charts, normals = scene.charts, scene.charts.normals()
    columns, rows = (
        np.maximum(np.ceil(charts.size[chart] / AMBIENT.ambient_cell_m - 1e-6), 1).astype(int) + 1
    ).tolist()
    width, height = charts.size[chart].tolist()
    inset = np.minimum(DAYLIGHT.ray_lift_m, 0.5 * charts.size[chart])
    across = np.clip(np.linspace(0, width, columns) + DAYLIGHT.ray_shift_m, inset[0], width - inset[0])
    down = np.clip(np.linspace(0, height, rows) + DAYLIGHT.ray_shift_m, inset[1], height - inset[1])
    points = charts.points(chart, across[None, :], down[:, None]).reshape(-1, 3) + DAYLIGHT.ray_lift_m * normals[chart]
    frame = np.stack([charts.axis_u[chart], charts.axis_v[chart], normals[chart]])
    rays = multiply_matrices(hemisphere_directions(), frame)
    shape = (len(points), *rays.shape)
    origins, rays = np.broadcast_to(points[:, None], shape), np.broadcast_to(rays, shape)
    depth, hit = scene.caster.cast(origins, rays)
    far, up = depth > AMBIENT.occluder_range_m, rays[..., 2] >= 0
    free, land = far & up, far & ~up
    behind = ~far & (np.einsum("prk,prk->pr", normals[hit], rays) > 0)
    normal = np.where(land[..., None], [0.0, 0.0, 1.0], normals[hit])
    albedo = np.where(land | (charts.kind[hit] == ChartKind.GROUND), AMBIENT.ground_albedo, AMBIENT.surface_albedo)
    sky = np.where(free, 1.0, AMBIENT.occluder_sky_share * albedo * (0.5 + 0.5 * normal[..., 2]))
    cosine = np.where(free, 0.0, np.maximum(multiply_matrices(normal, sun_direction(sun)), 0.0))
    is_lit = ~far & ~behind & (cosine > 0)
    cosine[is_lit] *= _is_sunlit(scene, origins[is_lit] + depth[is_lit][:, None] * rays[is_lit], normal[is_lit], sun)
    reflected = np.where(behind, 0.0, albedo * cosine)
    light = [np.where(behind, 0.0, sky).mean(axis=1), reflected.mean(axis=1)]
    hidden = behind.mean(axis=1) > DAYLIGHT.max_back_face_share
    grid = (np.zeros(1, np.int64), np.array([rows]), np.array([columns]))
    for share in light:
        fill_daylight_inside_buildings(share, hidden, *grid)
    skylight, bounce = (share.reshape(rows, columns) / AMBIENT.typical_sky_share for share in light)
    total = skylight + bounce * (SUN_LIGHT.mean() / SKY_LIGHT.mean())
    exposure = AMBIENT.max_ambient_light / (total + AMBIENT.max_ambient_light - 1)
    return (skylight * exposure).astype(np.float32), (bounce * exposure).astype(np.float32)


def _is_sunlit(scene: Scene, places: Float64Array, normal: Float64Array, sun: Sun) -> BoolArray:
    """Return (n,) bool, True where the sun reaches places (n, 3) of surfaces with normals (n, 3)."""
    towards = np.broadcast_to(sun_direction(sun), places.shape)
    depth, _ = scene.caster.cast(places + SUNLIGHT.ray_lift_m * normal, towards)
    return depth > SUNLIGHT.max_shadow_reach_m - AMBIENT.occluder_range_m
