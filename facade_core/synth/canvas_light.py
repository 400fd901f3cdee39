"""Light on a canvas: a warm sun from the upper left, a cool sky, shadows cast along the relief."""

from __future__ import annotations

import cv2
import numpy as np

from facade_core.synth.canvas import Canvas, Plate, gaussian_blur

SUN_COLOUR = np.array([0.720, 0.690, 0.640], np.float32)
SKY_COLOUR = np.array([0.285, 0.305, 0.335], np.float32)
# How far a shadow falls to the right and down, in metres per metre that its caster stands out.
SHADOW_RIGHT_PER_METRE, SHADOW_DOWN_PER_METRE = 0.50, 0.78
MAX_RELIEF_M = 1.0  # metres; nothing on a facade stands out more


def light_canvas(canvas: Canvas) -> np.ndarray:
    """Light the canvas: (H, W, 3) float32 in linear light, plates included."""
    shadow = _cast_shadows(canvas.relief, canvas.scale)
    for plate in canvas.plates:
        _add_plate_shadow(shadow, plate, canvas.scale)
    sun = (1 - shadow) * _sun_share(canvas.relief, canvas.scale)
    sky = _sky_share(canvas.relief, canvas.scale)
    # Glass shows what it mirrors, which the light on the wall hardly changes.
    sun += (0.62 - sun) * (canvas.gloss * np.float32(0.40))
    sky += (1.0 - sky) * (canvas.gloss * np.float32(0.30))
    lit = np.empty_like(canvas.albedo)
    for channel in range(3):
        np.multiply(canvas.albedo[..., channel], sun * SUN_COLOUR[channel] + sky * SKY_COLOUR[channel], out=lit[..., channel])
    for plate in canvas.plates:
        rows, columns = plate.alpha.shape
        under = lit[plate.y : plate.y + rows, plate.x : plate.x + columns]
        alpha = plate.alpha[: under.shape[0], : under.shape[1], None]
        under += alpha * (plate.colour[: under.shape[0], : under.shape[1]] * (SUN_COLOUR + SKY_COLOUR) - under)
    return lit


def _cast_shadows(relief: np.ndarray, scale: float) -> np.ndarray:
    """Soft cast shadows (H, W) in 0..1: walk from every point towards the sun and look for relief above the ray."""
    # Half the raster is still finer than the picture, and the mouldings go on beyond its borders.
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
        y, x = pad_y - round(depth * SHADOW_DOWN_PER_METRE * scale), pad_x - round(depth * SHADOW_RIGHT_PER_METRE * scale)
        np.subtract(wide[y : y + rows, x : x + columns], half, out=above)
        above -= np.float32(depth)
        # The nearer the ray's blocker stands, the sharper the shadow's edge.
        above *= np.float32(1 / (0.012 + 0.16 * depth))
        np.maximum(highest, above, out=highest)
    soft = np.minimum(highest, 1, out=highest) * np.float32(0.88)
    return cv2.resize(soft, relief.shape[::-1], interpolation=cv2.INTER_LINEAR)


def _add_plate_shadow(shadow: np.ndarray, plate: Plate, scale: float) -> None:
    dy, dx = round(plate.depth * SHADOW_DOWN_PER_METRE * scale), round(plate.depth * SHADOW_RIGHT_PER_METRE * scale)
    pad = max(2, round(0.08 * scale))
    alpha = plate.alpha
    if plate.is_hinged:
        rows, columns = alpha.shape
        shear = np.array([[1, dx / rows, 0], [0, 1 + dy / rows, 0]], np.float64)
        alpha, dy, dx = cv2.warpAffine(alpha, shear, (columns + dx, rows + dy)), 0, 0
    soft = gaussian_blur(np.pad(alpha, pad), 0.035 * plate.depth * scale)
    y, x = plate.y + dy - pad, plate.x + dx - pad
    top, left = max(0, -y), max(0, -x)
    here = shadow[max(y, 0) : y + soft.shape[0], max(x, 0) : x + soft.shape[1]]
    np.maximum(here, 0.8 * soft[top : top + here.shape[0], left : left + here.shape[1]], out=here)


def _sun_share(relief: np.ndarray, scale: float) -> np.ndarray:
    """How squarely the surface faces the sun, 1 for the flat wall: edges to the upper left catch the light."""
    slope = np.zeros_like(relief)
    slope[1:] = 0.8 * (relief[1:] - relief[:-1])
    slope[:, 1:] += 0.5 * (relief[:, 1:] - relief[:, :-1])
    slope *= np.float32(scale)
    return 1 + np.float32(0.34) * np.tanh(slope)


def _sky_share(relief: np.ndarray, scale: float) -> np.ndarray:
    """Share of the sky that a point sees (ambient occlusion), from how far what is around and above it stands out."""
    open_ = np.ones_like(relief)
    # The sky is above: what lies under a ledge loses more than what lies over it.
    for radius, rise, strength in ((0.06, 0.03, 3.0), (0.30, 0.28, 3.0)):
        around = gaussian_blur(relief, radius * scale)
        drop = min(round(rise * scale), len(relief) - 1)
        buried = np.concatenate([np.repeat(around[:1], drop, 0), around[: len(around) - drop]]) - relief
        open_ *= 1 / (1 + np.float32(strength) * np.maximum(buried, 0))
    return open_
