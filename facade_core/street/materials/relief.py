"""What stands out of a facade and what lies back in it, by its labels, and the small shadows of that."""

from __future__ import annotations

import numpy as np

from facade_core.core.labels import FacadeClass
from facade_core.core.numba_cache import njit

# Metres that openings lie back, and that a balcony's slab and a sill stand out; how high these two are, metres.
OPENING_DEPTH_M, BALCONY_DEPTH_M, SILL_DEPTH_M = 0.15, 0.45, 0.07
BALCONY_SLAB_HEIGHT_M, SILL_HEIGHT_M = 0.25, 0.07
# No shadow is longer than so many times what casts it.
MAX_SHADOW_RATIO = 2.5
# Metres over which a shadow's edge fades beside what casts it, and so much more for each metre from there.
EDGE_WIDTH_M, EDGE_SPREAD = 0.012, 0.12
# Metres around a texel whose brightness tells whether it is in the shade already.
SHADE_WINDOW_M = 1.6


def relief_depth(labels: np.ndarray, density: float) -> np.ndarray:
    """Metres (h, w) float32 that the texels of a facade with labels (h, w) stand out."""
    depth = np.where(
        np.isin(labels, (FacadeClass.WINDOW, FacadeClass.DOOR, FacadeClass.SHOP, FacadeClass.BALCONY)),
        np.float32(-OPENING_DEPTH_M),
        np.float32(0),
    )
    wall = labels == FacadeClass.WALL
    for name, high, out in ((FacadeClass.BALCONY, BALCONY_SLAB_HEIGHT_M, BALCONY_DEPTH_M), (FacadeClass.WINDOW, SILL_HEIGHT_M, SILL_DEPTH_M)):
        here, rows = labels == name, max(1, round(high * density))
        if name == FacadeClass.BALCONY:  # its lowest rows: below it is something else
            depth[:-rows][here[:-rows] & ~here[rows:]] = out
        else:  # the wall right below it
            depth[rows:][wall[rows:] & here[:-rows]] = out
    return depth


def cast_shadows(
    colour: np.ndarray, labels: np.ndarray, density: float, towards: np.ndarray, dark: float
) -> np.ndarray:
    """How much of the sun's light the relief of a facade keeps off its texels, (h, w) float32 in 0..1.

    colour (h, w, 3) uint8 with labels (h, w); towards (3,): the sun along the chart's width, down it and out of it; dark: how
    bright what is in the shade is, of what is not. A texel that is as dark beside its neighbours of one depth already holds
    that shadow, and takes no other.
    """
    import cv2

    depth = relief_depth(labels, density)
    right, down = np.clip(towards[:2] / towards[2], -MAX_SHADOW_RATIO, MAX_SHADOW_RATIO)
    shadow: np.ndarray = cv2.blur(_trace_shadows(depth, float(right), float(down), float(density)), (3, 3))
    grey = cv2.cvtColor(np.ascontiguousarray(colour), cv2.COLOR_RGB2GRAY).astype(np.float32)
    side = 2 * round(SHADE_WINDOW_M * density / 2) + 1
    back = depth < 0
    for own in (back, ~back):
        weight = own.astype(np.float32)
        mean = cv2.boxFilter(grey * weight, -1, (side, side)) / np.maximum(
            cv2.boxFilter(weight, -1, (side, side)), 1e-6
        )
        lit = np.clip((grey / np.maximum(mean, 1) - dark) / max(1 - dark, 1e-6), 0, 1)
        shadow[own] *= lit[own]
    return shadow


@njit(cache=True, nogil=True, error_model="numpy")
def _trace_shadows(depth: np.ndarray, right: float, down: float, density: float) -> np.ndarray:
    """Shadows (h, w) float32 of depths (h, w) float32, metres, where the sun is so far aside and down for each metre out."""
    height, width = depth.shape
    highest = depth[0, 0]
    for row in range(height):
        for column in range(width):
            highest = max(highest, depth[row, column])
    shadow = np.zeros(depth.shape, np.float32)
    least = 1 / (max(abs(right), abs(down), 1e-3) * density)
    for row in range(height):
        for column in range(width):
            own = depth[row, column]
            rise, found = least, 0.0
            while rise < highest - own and found < 1:
                y, x = row + round(rise * down * density), column + round(rise * right * density)
                if y < 0 or y >= height or x < 0 or x >= width:
                    break
                found = max(found, (depth[y, x] - own - rise) / (EDGE_WIDTH_M + EDGE_SPREAD * rise))
                rise += least
            shadow[row, column] = min(found, 1.0)
    return shadow
