"""Heights of a surface by labels and materials, and what follows from them for light: normals and occlusion."""

from __future__ import annotations

import numpy as np

from facade_core.core.labels import FacadeClass
from facade_core.export.lighting.surface_materials import RELIEF
from facade_core.street.materials.relief import relief_depth

# Bars and frames stand so far out of their panes, metres.
FRAME_M = 0.04
# Steps fall by at most so many metres a metre: what is steeper would turn its back on every light.
STEEPEST = 1.6
# What is so many times its surroundings' brightness darker lies at the ground of a joint, and metres around it that count.
DARKEST, AROUND_M = 0.3, 0.35
# A texel that lies so far below what is around it, metres within so many, sees this share of the sky.
SUNK_M, BESIDE_M, SUNK_SEES = 0.2, 0.25, 0.55


def heights(
    labels: np.ndarray | None, substance: np.ndarray, grey: np.ndarray, frames: np.ndarray, density: float
) -> np.ndarray:
    """Metres (h, w) float32 that texels stand out: openings, slabs and sills by labels (h, w), as shadows fall on them;
    frames (h, w) bool; and joints and pores of each substance (h, w), by how much darker than around them they are drawn, grey
    (h, w) float32."""
    import cv2

    side = 2 * max(1, round(AROUND_M * density / 2)) + 1
    mean = np.maximum(cv2.blur(grey, (side, side), borderType=cv2.BORDER_REPLICATE), 1)
    out = np.clip((grey / mean - 1) / DARKEST, -1, 0.5) * RELIEF[substance]
    if labels is not None:
        # balconies and shops have ragged edges: their steps would glitter
        out += relief_depth(
            np.where(np.isin(labels, (FacadeClass.BALCONY, FacadeClass.SHOP)), FacadeClass.WALL, labels), density
        )
        out[frames] += np.float32(FRAME_M)
    return out.astype(np.float32)


def normals(height: np.ndarray, density: float, turn: np.ndarray | None = None) -> np.ndarray:
    """Unit normals (h, w, 3) float32 of heights (h, w) metres, x right, y up, z out; by differences across each texel; turn
    (h, w, 2): slopes to the right and up that are added, as panes lean."""
    padded = np.pad(height, 1, mode="edge")
    right = (padded[1:-1, 2:] - padded[1:-1, :-2]) * np.float32(density / 2)
    up = (padded[:-2, 1:-1] - padded[2:, 1:-1]) * np.float32(density / 2)
    slope = np.clip(np.stack([right, up], axis=-1), -STEEPEST, STEEPEST)
    if turn is not None:
        slope = slope + turn
    found = np.concatenate([-slope, np.ones((*height.shape, 1), np.float32)], axis=-1)
    return (found / np.sqrt((found**2).sum(axis=-1, keepdims=True))).astype(np.float32)


def sunk(height: np.ndarray, density: float) -> np.ndarray:
    """The share of the sky (h, w) float32 that what lies around a texel leaves it, 1 where it does not lie lower."""
    import cv2

    side = 2 * max(1, round(BESIDE_M * density)) + 1
    mean = cv2.blur(height, (side, side), borderType=cv2.BORDER_REPLICATE)
    below = np.clip((mean - height) / np.float32(SUNK_M), 0, 1)
    return (1 - (1 - np.float32(SUNK_SEES)) * below).astype(np.float32)
