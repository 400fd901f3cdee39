"""Height maps of charts from labels and materials, with the normals and occlusion that follow from them."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.export.lighting.pbr_materials import RELIEF
from facade_core.export.lighting.settings import HEIGHT_MAPS
from facade_core.street.materials.relief import relief_depth


def estimate_heights(
    labels: UInt8Array | None,
    material: UInt8Array,
    grey: Float32Array,
    frames: BoolArray,
    density: float,
    *,
    has_relief: bool = False,
) -> Float32Array:
    """Estimate the relief of a chart: openings, slabs and sills by label, joints and pores by brightness.

    Parameters
    ----------
    labels : (h, w) facade classes; None for charts that are no facade.
    material : (h, w) PbrMaterial.
    grey : (h, w) float32 brightness; darker than its surroundings means lower.
    frames : (h, w) bool, window frames and bars.
    density : texels per metre.
    has_relief : openings are geometry, which shades itself: no map sets them back again.

    Returns
    -------
    (h, w) float32 metres outward.
    """
    import cv2

    side = 2 * max(1, round(HEIGHT_MAPS.contrast_window_m * density / 2)) + 1
    mean = np.maximum(cv2.blur(grey, (side, side), borderType=cv2.BORDER_REPLICATE), 1)
    out = np.clip((grey / mean - 1) / HEIGHT_MAPS.full_relief_contrast, -1, 0.5) * RELIEF[material]
    if labels is not None:
        # ragged edges of balconies and shops would glitter
        depth = relief_depth(
            np.where(np.isin(labels, (FacadeClass.BALCONY, FacadeClass.SHOP)), FacadeClass.WALL, labels), density
        )
        out += np.maximum(depth, 0) if has_relief else depth
        out[frames] += np.float32(HEIGHT_MAPS.frame_relief_m)
    return out.astype(np.float32)


def normals_from_heights(
    height: Float32Array, density: float, slope_offset: Float32Array | None = None
) -> Float32Array:
    """Compute normals of a height map by central differences.

    Parameters
    ----------
    height : (h, w) metres.
    density : texels per metre.
    slope_offset : (h, w, 2) slopes to the right and up that are added, for tilted panes.

    Returns
    -------
    (h, w, 3) float32 unit vectors, x right, y up, z out.
    """
    padded = np.pad(height, 1, mode="edge")
    right = (padded[1:-1, 2:] - padded[1:-1, :-2]) * np.float32(density / 2)
    up = (padded[:-2, 1:-1] - padded[2:, 1:-1]) * np.float32(density / 2)
    slope = np.clip(np.stack([right, up], axis=-1), -HEIGHT_MAPS.max_slope, HEIGHT_MAPS.max_slope)
    if slope_offset is not None:
        slope = slope + slope_offset
    found = np.concatenate([-slope, np.ones((*height.shape, 1), np.float32)], axis=-1)
    normals: Float32Array = (found / np.sqrt((found**2).sum(axis=-1, keepdims=True))).astype(np.float32)
    return normals


def cavity_visibility(height: Float32Array, density: float) -> Float32Array:
    """Compute the share of the sky that a texel sees past its surroundings, from the mean height around it.

    Parameters
    ----------
    height : (h, w) metres.
    density : texels per metre.

    Returns
    -------
    (h, w) float32, 1 where the texel is not lower than its surroundings.
    """
    import cv2

    side = 2 * max(1, round(HEIGHT_MAPS.cavity_window_m * density)) + 1
    mean = cv2.blur(height, (side, side), borderType=cv2.BORDER_REPLICATE)
    below = np.clip((mean - height) / np.float32(HEIGHT_MAPS.full_cavity_depth_m), 0, 1)
    visibility: Float32Array = (1 - (1 - np.float32(HEIGHT_MAPS.min_cavity_visibility)) * below).astype(np.float32)
    return visibility
