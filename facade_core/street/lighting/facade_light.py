"""A facade that was made of an exemplar in the light of its place: of the sky, of the sun, and of what stands around."""

from __future__ import annotations

import numpy as np

from facade_core.core.labels import FacadeClass
from facade_core.core.numba_cache import njit
from facade_core.core.types import Sun
from facade_core.geometry.scene import Scene
from facade_core.street.lighting.ambient import ambient
from facade_core.street.lighting.sun import SKY_LIGHT, SUN_LIGHT, on_chart
from facade_core.street.materials.relief import cast_shadows
from facade_core.street.materials.stains import stains


def in_its_light(
    scene: Scene,
    chart: int,
    sun: Sun,
    colour: np.ndarray,
    made: np.ndarray,
    labels: np.ndarray,
    light: np.ndarray,
    seed: int,
) -> np.ndarray:
    """A facade's colour (h, w, 3) uint8, with labels (h, w), in so much of the sun's light (h, w) and in the sky's.

    Where it was `made` (h, w) it has the shadows of its relief, what its surroundings leave of the sky and throw back, and on
    its walls stains; elsewhere it is a picture, which has all of that.
    """
    density = float(scene.placement.texels_per_metre[chart])
    towards, dark = on_chart(scene.charts, chart, sun)
    if towards[2] > 0 and light.any():  # a wall that the sun is behind has no relief that it shines on
        light = light * (1 - made * cast_shadows(colour, labels, density, towards, dark))
    origin, along, down = (getattr(scene.charts, name)[chart] for name in ("origin", "axis_u", "axis_v"))
    tones = stains(colour, labels, density, (float(origin @ along), float(origin @ down)), seed)
    above, back = ambient(scene, chart, sun)
    out = np.empty_like(colour)
    laid_over(colour, made, labels == FacadeClass.WALL, light.astype(np.float32), above, back, tones, out)
    return out


@njit(cache=True, inline="always")
def _between(grid: np.ndarray, row: int, column: int, down: float, right: float) -> float:
    upper = grid[row, column] * (1 - right) + grid[row, column + 1] * right
    return upper * (1 - down) + (grid[row + 1, column] * (1 - right) + grid[row + 1, column + 1] * right) * down


@njit(cache=True, nogil=True, error_model="numpy")
def laid_over(
    colour: np.ndarray,
    made: np.ndarray,
    wall: np.ndarray,
    light: np.ndarray,
    above: np.ndarray,
    back: np.ndarray,
    tones: np.ndarray,
    out: np.ndarray,
) -> None:
    """Colours (h, w, 3) uint8 in the sky's light and so much of the sun's (h, w) float32, into `out`.

    Where they were made (h, w): in that part of the sky's and with so much of the sun's beside, of grids from border to border
    (rows, columns), and of the wall (h, w) in tones of places (r, c) that are evenly spread, half a step within the border.
    """
    height, width = made.shape
    rows, columns, tall, wide = above.shape[0], above.shape[1], tones.shape[0], tones.shape[1]
    for row in range(height):
        at = (row + 0.5) / height
        v, w = at * (rows - 1), min(max(at * tall - 0.5, 0.0), tall - 1.0)
        v0, w0 = min(int(v), rows - 2), min(int(w), tall - 2)
        for column in range(width):
            sky, sun, tone = 1.0, np.float64(light[row, column]), 1.0
            if made[row, column]:
                at = (column + 0.5) / width
                u = at * (columns - 1)
                u0 = min(int(u), columns - 2)
                sky = _between(above, v0, u0, v - v0, u - u0)
                sun += _between(back, v0, u0, v - v0, u - u0)
                if wall[row, column]:
                    u = min(max(at * wide - 0.5, 0.0), wide - 1.0)
                    u0 = min(int(u), wide - 2)
                    tone = _between(tones, w0, u0, w - w0, u - u0)
            for band in range(3):
                level = colour[row, column, band] * tone * (SKY_LIGHT[band] * sky + SUN_LIGHT[band] * sun)
                out[row, column, band] = np.uint8(min(level + 0.5, 255.0))
