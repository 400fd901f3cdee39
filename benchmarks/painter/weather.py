"""Weathering of a wall: uneven plaster, rain streaks under sills, soot under cornices, dirt near the ground."""

from __future__ import annotations

import numpy as np

from benchmarks.painter.canvas import Canvas, fractal_noise, smooth_noise


def apply_weathering(
    canvas: Canvas, sills: list[tuple[float, float, float]], ledges: list[float], rng: np.random.Generator
) -> None:
    """Darken the albedo in place; glass stays clean.

    Parameters
    ----------
    canvas : changed in place.
    sills : x0, x1, y of each sill in metres.
    ledges : y of each ledge in metres.
    rng : source of randomness.
    """
    shape = canvas.relief.shape
    rows, columns = shape
    scale = canvas.scale
    # Runs of water are columns of noise, stretched downwards.
    runs = (
        0.15
        + 0.55 * smooth_noise(shape, (1.3 * scale, 0.06 * scale), rng)
        + 0.55 * smooth_noise(shape, (2.0 * scale, 0.3 * scale), rng)
    )
    np.clip(runs, 0, 2.0, out=runs)
    dirt = np.zeros(shape, np.float32)
    for x0, x1, y in sills:
        at = canvas.region(x0, y, x1, y + float(rng.uniform(0.9, 1.9)))
        tall, wide = dirt[at].shape
        if not tall or not wide:
            continue
        fade = np.exp(-2.6 * np.linspace(0, 1, tall, dtype=np.float32)) - np.float32(np.exp(-2.6))
        # Water leaves a sill at its ends.
        ends = 0.45 + 0.75 * np.abs(np.linspace(-1, 1, wide, dtype=np.float32)) ** 4
        dirt[at] += np.float32(0.50) * fade[:, None] * ends[None, :] * runs[at]
    for y in ledges:
        at = canvas.region(0, y, canvas.width_m, y + 1.5)
        fade = np.exp(-3.0 * np.linspace(0, 1, dirt[at].shape[0], dtype=np.float32))
        dirt[at] += np.float32(0.28) * fade[:, None] * runs[at]
    reach = min(rows, canvas.to_pixels(1.5))
    rise = np.linspace(0, 1, reach, dtype=np.float32)[:, None] ** 2.2
    dirt[rows - reach :] += (
        rise * np.float32(0.28) * np.clip(0.9 + 0.3 * smooth_noise((reach, columns), 0.6 * scale, rng), 0, 2)
    )
    # Soot and splashes darken a wall towards its foot, and patches of it more than others.
    dirt += np.linspace(-0.06, 0.10, rows, dtype=np.float32)[:, None]
    dirt += np.float32(0.06) * fractal_noise(shape, 3.2 * scale, 4, rng)
    dirt *= 1 - canvas.gloss
    # Plaster was patched and repainted: the hue drifts a little from place to place.
    drift = np.float32(0.02) * fractal_noise(shape, 5.0 * scale, 2, rng) * (1 - canvas.gloss)
    left = np.exp(-dirt)
    canvas.albedo[..., 0] *= left * (1 + drift)
    canvas.albedo[..., 1] *= left
    # Dirt takes more of the blue than of the red.
    canvas.albedo[..., 2] *= left * (1 - 0.08 * dirt - drift)
