"""What lights a wall beside the sun itself: the sky that its places see, and what is thrown back once by what stands around."""

from __future__ import annotations

import numpy as np

from facade_core.core.types import Sun
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.daylight import ASIDE_M, INSIDE, LIFT_M, hemisphere, spread
from facade_core.geometry.scene import Scene
from facade_core.street.lighting.sun import RAY_LIFT_M as OFF_M
from facade_core.street.lighting.sun import MAX_SHADOW_REACH_M, SKY_LIGHT, SUN_LIGHT, sun_direction

# Metres between the places of a wall that are looked from, its border's among them; light is linear between them.
AMBIENT_CELL_M = 3.0
# What stands farther than this is haze as bright as the sky above the horizon, and as the ground below it.
OCCLUDER_RANGE_M = 40.0
# Of the light that falls on them ground and all else throw this much back.
GROUND_ALBEDO, SURFACE_ALBEDO = 0.25, 0.4
# What stands around sees this much of the sky that its tilt would show it in the open.
OCCLUDER_SKY_SHARE = 0.6
# What lights most walls of a street is held for a light of 1; more and less differ from it as in a picture that has both, which
# no light brings beyond MOST.
TYPICAL_SKY_SHARE, MAX_AMBIENT_LIGHT = 0.4, 1.6


def ambient_light(scene: Scene, chart: int, sun: Sun) -> tuple[np.ndarray, np.ndarray]:
    """How much of the sky's light, and of the sun's thrown back, reaches places of a chart from border to border, both
    (rows, columns) float32 and of what most walls of a street have of the sky's.

    A ray that meets nothing within OCCLUDER_RANGE_M brings the sky's light. One that meets a surface brings what that throws back of
    the sky's, and of the sun's where it lies in it. Nothing farther than REACH_M decides.
    """
    charts, normals = scene.charts, scene.charts.normal()
    columns, rows = (np.maximum(np.ceil(charts.size[chart] / AMBIENT_CELL_M - 1e-6), 1).astype(int) + 1).tolist()
    width, height = charts.size[chart].tolist()
    inset = np.minimum(LIFT_M, 0.5 * charts.size[chart])
    across = np.clip(np.linspace(0, width, columns) + ASIDE_M, inset[0], width - inset[0])
    down = np.clip(np.linspace(0, height, rows) + ASIDE_M, inset[1], height - inset[1])
    points = charts.points(chart, across[None, :], down[:, None]).reshape(-1, 3) + LIFT_M * normals[chart]
    frame = np.stack([charts.axis_u[chart], charts.axis_v[chart], normals[chart]])
    rays = hemisphere() @ frame
    shape = (len(points), *rays.shape)
    origins, rays = np.broadcast_to(points[:, None], shape), np.broadcast_to(rays, shape)
    depth, met = scene.caster.cast(origins, rays)
    far, up = depth > OCCLUDER_RANGE_M, rays[..., 2] >= 0
    free, land = far & up, far & ~up
    behind = ~far & (np.einsum("prk,prk->pr", normals[met], rays) > 0)
    normal = np.where(land[..., None], [0.0, 0.0, 1.0], normals[met])
    back = np.where(land | (charts.kind[met] == ChartKind.GROUND), GROUND_ALBEDO, SURFACE_ALBEDO)
    sky = np.where(free, 1.0, OCCLUDER_SKY_SHARE * back * (0.5 + 0.5 * normal[..., 2]))
    cosine = np.where(free, 0.0, np.maximum(normal @ sun_direction(sun), 0.0))
    asked = ~far & ~behind & (cosine > 0)
    cosine[asked] *= _is_sunlit(scene, origins[asked] + depth[asked][:, None] * rays[asked], normal[asked], sun)
    thrown = np.where(behind, 0.0, back * cosine)
    light = [np.where(behind, 0.0, sky).mean(axis=1), thrown.mean(axis=1)]
    hidden = behind.mean(axis=1) > INSIDE
    one = (np.zeros(1, np.int64), np.array([rows]), np.array([columns]))
    for share in light:
        spread(share, hidden, *one)
    above, beside = (share.reshape(rows, columns) / TYPICAL_SKY_SHARE for share in light)
    whole = above + beside * (SUN_LIGHT.mean() / SKY_LIGHT.mean())
    shown = MAX_AMBIENT_LIGHT / (whole + MAX_AMBIENT_LIGHT - 1)
    return (above * shown).astype(np.float32), (beside * shown).astype(np.float32)


def _is_sunlit(scene: Scene, places: np.ndarray, normal: np.ndarray, sun: Sun) -> np.ndarray:
    """Whether nothing stands between places (n, 3) of surfaces with normals (n, 3) and the sun, (n,) bool."""
    towards = np.broadcast_to(sun_direction(sun), places.shape)
    depth, _ = scene.caster.cast(places + OFF_M * normal, towards)
    return depth > MAX_SHADOW_REACH_M - OCCLUDER_RANGE_M
