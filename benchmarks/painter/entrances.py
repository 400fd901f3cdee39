"""House doors as canvas tiles."""

from __future__ import annotations

import numpy as np

from benchmarks.painter.canvas import Canvas, hex_to_linear, smooth_noise
from benchmarks.painter.windows import glass_reflections
from facade_core.core.arrays import Float32Array


def paint_door_tile(
    shape: tuple[int, int], scale: float, colour: Float32Array, *, is_modern: bool, rng: np.random.Generator
) -> Canvas:
    """Paint a two-leaved door under a fanlight.

    Parameters
    ----------
    shape : rows and columns of the tile.
    scale : raster pixels per metre.
    colour : (3,) linear light.
    is_modern : glaze the leaves from the knee up.
    rng : source of randomness.
    """
    tile = Canvas.blank(*shape, scale)
    w, h = tile.width_m, tile.height_m
    grain = 1 + 0.06 * smooth_noise(shape, (0.9 * scale, 0.02 * scale), rng)
    tile.albedo[:] = colour * grain[..., None]
    tile.relief[:] = -0.24
    light, step = 0.24 * h, min(0.16, 0.06 * h)
    glass = 0.6 * hex_to_linear("#35353a") + glass_reflections(shape, rng, posts=[shape[1] // 2], sky=0.1)

    def pane(x0: float, y0: float, x1: float, y1: float) -> None:
        at = tile.region(x0, y0, x1, y1)
        tile.albedo[at], tile.relief[at], tile.gloss[at] = glass[at], -0.28, 1.0

    pane(0.07, 0.07, w - 0.07, light - 0.05)
    for x in np.linspace(0, w, 5)[1:-1]:
        tile.fill_box(x - 0.02, 0.0, x + 0.02, light, colour * 1.15, -0.25)
    tile.fill_box(0, light - 0.06, w, light + 0.06, colour * 1.2, -0.18)
    for side in (0.0, w / 2):
        x0, x1 = side + 0.13, side + w / 2 - 0.13
        tall = h - light - step
        cuts = ((0.10, 0.80),) if is_modern else ((0.08, 0.50), (0.57, 0.72), (0.78, 0.95))
        for number, (a, b) in enumerate(cuts):
            y0, y1 = light + a * tall, light + b * tall
            if is_modern or number == 0:
                pane(x0, y0, x1, y1)
                if not is_modern:
                    tile.fill_box((x0 + x1) / 2 - 0.02, y0, (x0 + x1) / 2 + 0.02, y1, colour * 1.1, -0.25)
            else:
                tile.fill_box(x0, y0, x1, y1, colour * 0.72, -0.28)
                tile.fill_box(x0 + 0.06, y0 + 0.06, x1 - 0.06, y1 - 0.06, colour * 1.12, -0.23)
    tile.fill_box(w / 2 - 0.02, light, w / 2 + 0.02, h, colour * 0.45, -0.27)
    grip = light + 0.55 * (h - light)
    tile.fill_box(w / 2 + 0.06, grip, w / 2 + 0.095, grip + 0.22, hex_to_linear("#9a8658"), -0.18)
    tile.fill_box(0, 0, 0.06, h, colour * 1.15, -0.18)
    tile.fill_box(w - 0.06, 0, w, h, colour * 1.15, -0.18)
    tile.add_moulding(0, h - step, w, h, hex_to_linear("#9a958d"), (0.02, 0.02, 0.0))
    return tile


def paint_gate_tile(shape: tuple[int, int], scale: float, colour: Float32Array, *, rng: np.random.Generator) -> Canvas:
    """Paint a sectional gate for vehicles; arguments as in `paint_door_tile`."""
    tile = Canvas.blank(*shape, scale)
    w, h = tile.width_m, tile.height_m
    tile.albedo[:] = colour * (1 + 0.05 * smooth_noise(shape, (0.3 * scale, 0.9 * scale), rng))[..., None]
    tile.relief[:] = -0.14
    count = max(3, round(h / 0.55))
    cuts = np.linspace(0.08, h, count + 1)
    for y in cuts[:-1]:
        tile.fill_box(0, y - 0.015, w, y + 0.015, colour * 0.55, -0.17)
    lights = max(2, round((w - 0.3) / 0.75))
    y0, y1 = cuts[1] + 0.12, cuts[2] - 0.12
    for x in np.linspace(0.15, w - 0.15, lights + 1)[:-1]:
        at = tile.region(x + 0.08, y0, x + (w - 0.3) / lights - 0.08, y1)
        tile.albedo[at], tile.relief[at], tile.gloss[at] = 0.8 * hex_to_linear("#35353a"), -0.17, 1.0
    for x0, y0, x1, y1 in ((0, 0, 0.09, h), (w - 0.09, 0, w, h), (0, 0, w, 0.09)):
        tile.fill_box(x0, y0, x1, y1, colour * 0.8, -0.03)
    return tile
