"""Lighting of a canvas: a warm sun from the upper left, a cool sky, and shadows cast by the relief."""

from __future__ import annotations

import cv2
import numpy as np

from benchmarks.painter.canvas import Canvas, WallAttachment, gaussian_blur
from facade_core.core.arrays import Float32Array

SUN_COLOUR = np.array([0.720, 0.690, 0.640], np.float32)
SKY_COLOUR = np.array([0.285, 0.305, 0.335], np.float32)
# Metres that a shadow falls to the right and down, per metre that its caster projects from the wall.
SHADOW_RIGHT_PER_METRE = 0.50
SHADOW_DOWN_PER_METRE = 0.78
MAX_RELIEF_M = 1.0  # metres that anything projects from a facade


def shade_canvas(canvas: Canvas) -> Float32Array:
    """Shade a canvas and its plates with sun, sky and cast shadows.

    Returns
    -------
    lit : (H, W, 3) float32 linear light.
    """
    shadow = _cast_shadows(canvas.relief, canvas.scale)
    for plate in canvas.plates:
        _add_plate_shadow(shadow, plate, canvas.scale)
    sun = (1 - shadow) * _sun_share(canvas.relief, canvas.scale)
    sky = _sky_share(canvas.relief, canvas.scale)
    # Light on the wall hardly changes the reflections of glass.
    sun += (0.62 - sun) * (canvas.gloss * np.float32(0.40))
    sky += (1.0 - sky) * (canvas.gloss * np.float32(0.30))
    lit = np.empty_like(canvas.albedo)
    for channel in range(3):
        np.multiply(
            canvas.albedo[..., channel], sun * SUN_COLOUR[channel] + sky * SKY_COLOUR[channel], out=lit[..., channel]
        )
    for plate in canvas.plates:
        rows, columns = plate.alpha.shape
        under = lit[plate.y : plate.y + rows, plate.x : plate.x + columns]
        alpha = plate.alpha[: under.shape[0], : under.shape[1], None]
        under += alpha * (plate.colour[: under.shape[0], : under.shape[1]] * (SUN_COLOUR + SKY_COLOUR) - under)
    return lit


def _cast_shadows(relief: Float32Array, scale: float) -> Float32Array:
    """Return soft cast shadows (H, W) in 0..1, by a search for relief above the ray to the sun."""
    # Half the raster is still finer than the picture; mouldings continue beyond its borders.
    half = cv2.resize(relief, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    scale = scale / 2
    reach = min(MAX_RELIEF_M, float(relief.max() - relief.min()))
    pad_y, pad_x = round(reach * SHADOW_DOWN_PER_METRE * scale), round(reach * SHADOW_RIGHT_PER_METRE * scale)
    wide = np.pad(half, ((pad_y, 0), (pad_x, 0)), mode="edge")
    rows, columns = half.shape
    steps = max(2, int(np.ceil(pad_y / 0.8)))
    highest, above = np.zeros((rows, columns), np.float32), np.empty((rows, columns), np.float32)
    for step in range(1, steps + 1):
        depth = reach * step / steps
        y, x = (
            pad_y - round(depth * SHADOW_DOWN_PER_METRE * scale),
            pad_x - round(depth * SHADOW_RIGHT_PER_METRE * scale),
        )
        np.subtract(wide[y : y + rows, x : x + columns], half, out=above)
        above -= np.float32(depth)
        # The nearer the ray's blocker, the sharper the shadow's edge.
        above *= np.float32(1 / (0.012 + 0.16 * depth))
        np.maximum(highest, above, out=highest)
    soft = np.minimum(highest, 1, out=highest) * np.float32(0.88)
    return np.asarray(cv2.resize(soft, relief.shape[::-1], interpolation=cv2.INTER_LINEAR), soft.dtype)


def _add_plate_shadow(shadow: Float32Array, plate: WallAttachment, scale: float) -> None:
    dy, dx = round(plate.depth * SHADOW_DOWN_PER_METRE * scale), round(plate.depth * SHADOW_RIGHT_PER_METRE * scale)
    pad = max(2, round(0.08 * scale))
    alpha = plate.alpha
    if plate.is_hinged:
        rows, columns = alpha.shape
        shear = np.array([[1, dx / rows, 0], [0, 1 + dy / rows, 0]], np.float64)
        alpha = np.asarray(cv2.warpAffine(alpha, shear, (columns + dx, rows + dy)), alpha.dtype)
        dy = dx = 0
    soft = gaussian_blur(np.pad(alpha, pad), 0.035 * plate.depth * scale)
    y, x = plate.y + dy - pad, plate.x + dx - pad
    top, left = max(0, -y), max(0, -x)
    here = shadow[max(y, 0) : y + soft.shape[0], max(x, 0) : x + soft.shape[1]]
    np.maximum(here, 0.8 * soft[top : top + here.shape[0], left : left + here.shape[1]], out=here)


def _sun_share(relief: Float32Array, scale: float) -> Float32Array:
    """Return the share of sunlight per pixel, 1 for the flat wall; edges to the upper left are brighter."""
    slope = np.zeros_like(relief)
    slope[1:] = 0.8 * (relief[1:] - relief[:-1])
    slope[:, 1:] += 0.5 * (relief[:, 1:] - relief[:, :-1])
    slope *= np.float32(scale)
    return 1 + np.float32(0.34) * np.tanh(slope)


def _sky_share(relief: Float32Array, scale: float) -> Float32Array:
    """Return the share of the sky that a pixel sees (ambient occlusion), from the relief around and above it."""
    open_ = np.ones_like(relief)
    # The sky is above: a ledge darkens the wall below it more than the wall above.
    for radius, rise, strength in ((0.06, 0.03, 3.0), (0.30, 0.28, 3.0)):
        around = gaussian_blur(relief, radius * scale)
        drop = min(round(rise * scale), len(relief) - 1)
        buried = np.concatenate([np.repeat(around[:1], drop, 0), around[: len(around) - drop]]) - relief
        open_ *= 1 / (1 + np.float32(strength) * np.maximum(buried, 0))
    return open_
