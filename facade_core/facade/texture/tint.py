"""Tint that distinguishes walls of one exemplar: shade of the paint and reflections of the panes."""

from __future__ import annotations

import cv2
import numpy as np

from facade_core.core.arrays import Float64Array, UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.facade.texture.settings import TINT

_LAMP_GAIN = np.array([1.08, 1.02, 0.91], np.float32)


def tint_facade(
    image: UInt8Array, labels: UInt8Array, *, building_seed: int, seed: int, paint: Float64Array | None = None
) -> UInt8Array:
    """Tint a facade's walls and panes.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    labels : (H, W) uint8 class ids.
    building_seed : seed of the shade, common to all facades of a building.
    seed : seed of the panes.
    paint : (3,) factors of the walls' colour where it is known, instead of a shade.
    """
    shade = np.random.default_rng(building_seed)
    gain = np.exp(
        TINT.shade_deviation * np.clip(shade.standard_normal(), -2, 2)
        + TINT.hue_deviation * np.clip(shade.standard_normal(3), -2, 2)
    )
    walled = np.isin(
        labels,
        (FacadeClass.WALL, FacadeClass.BALCONY, FacadeClass.ROOF)
        if paint is None
        else (FacadeClass.WALL, FacadeClass.BALCONY),
    ).astype(np.float32)
    share = cv2.GaussianBlur(walled, (0, 0), 1.0, borderType=cv2.BORDER_REPLICATE)[..., None]
    light = 1 + share * ((gain if paint is None else paint).astype(np.float32) - 1)
    rng = np.random.default_rng(seed)
    count, _, boxes, _ = cv2.connectedComponentsWithStats(
        (labels == FacadeClass.WINDOW).astype(np.uint8), connectivity=4
    )
    for x, y, width, height, _ in boxes[1:count].tolist():
        pane = np.exp(
            TINT.pane_deviation * rng.standard_normal()
            + TINT.pane_slope_deviation * rng.standard_normal() * np.linspace(-0.5, 0.5, height)
        )
        warm = _LAMP_GAIN if rng.random() < TINT.lamp_probability else np.ones(3, np.float32)
        at = np.s_[y : y + height, x : x + width]
        # Frames keep their colour; pixels brighter than any interior count as frames.
        own = ((labels[at] == FacadeClass.WINDOW) & (image[at].min(axis=-1) < TINT.min_frame_light))[..., None]
        light[at] = np.where(own, light[at] * pane.astype(np.float32)[:, None, None] * warm, light[at])
    tinted: UInt8Array = np.clip(np.rint(image * light), 0, 255).astype(np.uint8)
    return tinted
