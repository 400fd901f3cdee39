"""Light on a facade from an exemplar: sky, sun and surroundings."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.core.numba_cache import njit
from facade_core.core.types import Sun
from facade_core.geometry.scene import Scene
from facade_core.street.lighting.ambient import ambient_light
from facade_core.street.lighting.sun import SKY_LIGHT, SUN_LIGHT, sun_in_chart_frame
from facade_core.street.materials.relief import relief_shadow_share
from facade_core.street.materials.stains import stain_tones


def relight_facade(
    scene: Scene,
    chart: int,
    sun: Sun,
    colour: UInt8Array,
    is_synthesised: BoolArray,
    labels: UInt8Array,
    light: Float32Array,
    seed: int,
) -> UInt8Array:
    """Apply sun and sky to a facade's colour.

    Synthesised parts get relief shadows, ambient light and, on walls, stains. Pictures already show all of these.

    Parameters
    ----------
    scene : the block's geometry.
    chart : row of the facade's chart.
    sun : position of the sun.
    colour : (h, w, 3) uint8.
    is_synthesised : (h, w) bool.
    labels : (h, w) class id.
    light : (h, w) share of sunlight.
    seed : seed of the stains.

    Returns
    -------
    (h, w, 3) uint8.
    """
    density = float(scene.placement.texels_per_metre[chart])
    towards, shadow_brightness = sun_in_chart_frame(scene.charts, chart, sun)
    if towards[2] > 0 and light.any():  # a wall that the sun is behind has no relief that it shines on
        light = light * (1 - is_synthesised * relief_shadow_share(colour, labels, density, towards, shadow_brightness))
    origin, along, down = (getattr(scene.charts, name)[chart] for name in ("origin", "axis_u", "axis_v"))
    tones = stain_tones(colour, labels, density, (float((origin * along).sum()), float((origin * down).sum())), seed)
    skylight, bounce = ambient_light(scene, chart, sun)
    out = np.empty_like(colour)
    apply_facade_light(
        colour, is_synthesised, labels == FacadeClass.WALL, light.astype(np.float32), skylight, bounce, tones, out
    )
    return out


@njit(cache=True, inline="always")
def _bilinear(grid: Float32Array, row: int, column: int, down: float, right: float) -> float:
    upper = grid[row, column] * (1 - right) + grid[row, column + 1] * right
    light: float = upper * (1 - down) + (grid[row + 1, column] * (1 - right) + grid[row + 1, column + 1] * right) * down
    return light


@njit(cache=True, nogil=True, error_model="numpy")
def apply_facade_light(
    colour: UInt8Array,
    is_synthesised: BoolArray,
    wall: BoolArray,
    light: Float32Array,
    sky_light: Float32Array,
    bounce_light: Float32Array,
    tones: Float32Array,
    out: UInt8Array,
) -> None:
    """Multiply colours by light, into `out`.

    Parameters
    ----------
    colour : (h, w, 3) uint8.
    is_synthesised : (h, w) bool; other texels get full skylight and no bounce or stain.
    wall : (h, w) bool, texels that `tones` apply to.
    light : (h, w) float32 share of sunlight.
    sky_light, bounce_light : (rows, columns) grids from border to border.
    tones : (r, c) grid, evenly spaced, half a step inside the border.
    out : (h, w, 3) uint8.
    """
    height, width = is_synthesised.shape
    rows, columns, tall, wide = sky_light.shape[0], sky_light.shape[1], tones.shape[0], tones.shape[1]
    for row in range(height):
        share = (row + 0.5) / height
        v, w = share * (rows - 1), min(max(share * tall - 0.5, 0.0), tall - 1.0)
        v0, w0 = min(int(v), rows - 2), min(int(w), tall - 2)
        for column in range(width):
            sky, sun, tone = 1.0, np.float64(light[row, column]), 1.0
            if is_synthesised[row, column]:
                share = (column + 0.5) / width
                u = share * (columns - 1)
                u0 = min(int(u), columns - 2)
                sky = _bilinear(sky_light, v0, u0, v - v0, u - u0)
                sun += _bilinear(bounce_light, v0, u0, v - v0, u - u0)
                if wall[row, column]:
                    u = min(max(share * wide - 0.5, 0.0), wide - 1.0)
                    u0 = min(int(u), wide - 2)
                    tone = _bilinear(tones, w0, u0, w - w0, u - u0)
            for band in range(3):
                level = colour[row, column, band] * tone * (SKY_LIGHT[band] * sky + SUN_LIGHT[band] * sun)
                out[row, column, band] = np.uint8(min(level + 0.5, 255.0))
