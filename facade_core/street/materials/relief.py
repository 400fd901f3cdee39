"""Relief of a facade by its labels, and the small shadows of it."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Float32Array, Float64Array, UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.core.numba_cache import njit
from facade_core.street.materials.settings import RELIEF, RELIEF_KERNELS


def relief_depth(labels: UInt8Array, density: float) -> Float32Array:
    """Compute the depth of a facade's texels.

    Parameters
    ----------
    labels : (h, w) class id.
    density : texels per metre.

    Returns
    -------
    (h, w) float32 metres outward.
    """
    depth = np.where(
        np.isin(labels, (FacadeClass.WINDOW, FacadeClass.DOOR, FacadeClass.SHOP, FacadeClass.BALCONY)),
        np.float32(-RELIEF.opening_depth_m),
        np.float32(0),
    )
    wall = labels == FacadeClass.WALL
    for name, high, out in (
        (FacadeClass.BALCONY, RELIEF.balcony_slab_height_m, RELIEF.balcony_depth_m),
        (FacadeClass.WINDOW, RELIEF.sill_height_m, RELIEF.sill_depth_m),
    ):
        here, rows = labels == name, max(1, round(high * density))
        if name == FacadeClass.BALCONY:  # its lowest rows
            depth[:-rows][here[:-rows] & ~here[rows:]] = out
        else:  # the wall below it
            depth[rows:][wall[rows:] & here[:-rows]] = out
    return depth


def relief_shadow_share(
    colour: UInt8Array, labels: UInt8Array, density: float, towards: Float64Array, dark: float
) -> Float32Array:
    """Compute the share of sunlight that a facade's relief blocks, (h, w) float32 in 0..1.

    A texel already as dark against its neighbours of the same depth has that shadow painted in, and gets none.

    Parameters
    ----------
    colour : (h, w, 3) uint8.
    labels : (h, w) class id.
    density : texels per metre.
    towards : (3,) direction to the sun along the chart's width, down and outward.
    dark : brightness of shadow relative to full light.
    """
    import cv2

    depth = relief_depth(labels, density)
    right, down = np.clip(towards[:2] / towards[2], -RELIEF.max_shadow_ratio, RELIEF.max_shadow_ratio)
    traced = _trace_shadows(depth, float(right), float(down), float(density))
    shadow = np.asarray(cv2.blur(traced, (3, 3)), np.float32)
    grey = cv2.cvtColor(np.ascontiguousarray(colour), cv2.COLOR_RGB2GRAY).astype(np.float32)
    side = 2 * round(RELIEF.shade_window_m * density / 2) + 1
    recessed = depth < 0
    for level in (recessed, ~recessed):
        weight = level.astype(np.float32)
        mean = cv2.boxFilter(grey * weight, -1, (side, side)) / np.maximum(
            cv2.boxFilter(weight, -1, (side, side)), 1e-6
        )
        lit = np.clip((grey / np.maximum(mean, 1) - dark) / max(1 - dark, 1e-6), 0, 1)
        shadow[level] *= lit[level]
    return shadow


@njit(cache=True, nogil=True, error_model="numpy")
def _trace_shadows(depth: Float32Array, right: float, down: float, density: float) -> Float32Array:
    """Trace shadows (h, w) of depths (h, w) metres.

    right, down: offset of the sun per metre outward.
    """
    height, width = depth.shape
    highest = depth[0, 0]
    for row in range(height):
        for column in range(width):
            highest = max(highest, depth[row, column])
    shadow = np.zeros(depth.shape, np.float32)
    step = 1 / (max(abs(right), abs(down), 1e-3) * density)
    for row in range(height):
        for column in range(width):
            receiver = depth[row, column]
            rise, shade = step, 0.0
            while rise < highest - receiver and shade < 1:
                y, x = row + round(rise * down * density), column + round(rise * right * density)
                if y < 0 or y >= height or x < 0 or x >= width:
                    break
                shade = max(
                    shade,
                    (depth[y, x] - receiver - rise) / (RELIEF_KERNELS.edge_width_m + RELIEF_KERNELS.edge_spread * rise),
                )
                rise += step
            shadow[row, column] = min(shade, 1.0)
    return shadow
