"""Conversion between sRGB and linear light, in which vertex colours multiply textures (glTF 2.0, 3.9.2)."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, FloatArray, UInt8Array

_BYTES = np.arange(256) / 255
# IEC 61966-2-1.
_LINEAR = np.where(_BYTES <= 0.04045, _BYTES / 12.92, ((_BYTES + 0.055) / 1.055) ** 2.4).astype(np.float32)


def srgb_to_linear(image: UInt8Array) -> Float32Array:
    """Convert sRGB bytes (...) to linear light (...), 0 to 1."""
    return _LINEAR[image]


def linear_to_srgb(light: FloatArray) -> UInt8Array:
    """Convert linear light (...) to sRGB bytes (...); values beyond 0 to 1 are clipped."""
    x = np.clip(light, 0, 1)
    encoded = np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.power(np.maximum(x, 1e-9), 1 / 2.4) - 0.055)
    srgb: UInt8Array = np.rint(255 * encoded).astype(np.uint8)
    return srgb


def smooth_known_light(light: FloatArray, known: BoolArray, sigma: float, *, wrap: bool = False) -> Float32Array:
    """Compute Gaussian means of the known light around each pixel.

    Where no known pixel is near, ever wider means are used (pull-push).

    Parameters
    ----------
    light : (height, width, 3) linear light.
    known : (height, width).
    sigma : pixels.
    wrap : treat the picture as periodic.

    Returns
    -------
    (height, width, 3) linear light.
    """
    import cv2

    if wrap:
        pad = int(min(4 * sigma, *light.shape[:2]))
        spread = [(pad, pad), (pad, pad), (0, 0)]
        grown = smooth_known_light(np.pad(light, spread, "wrap"), np.pad(known, spread[:2], "wrap"), sigma)
        return grown[pad:-pad, pad:-pad]
    weight = known.astype(np.float32)
    total, share = light * weight[..., None], weight
    found = np.zeros_like(light, np.float32)
    left = np.ones(known.shape, np.float32)
    step, height, width = sigma, *known.shape
    for _ in range(8):
        # a wide mean loses nothing on fewer pixels
        factor = max(1, int(step / 3))
        size = (max(1, width // factor), max(1, height // factor))
        small = [cv2.resize(part, size, interpolation=cv2.INTER_AREA) for part in (total, share)]
        blurred = [
            cv2.GaussianBlur(part, (0, 0), max(step / factor, 0.3), borderType=cv2.BORDER_REPLICATE) for part in small
        ]
        numerator, denominator = (cv2.resize(part, (width, height), interpolation=cv2.INTER_LINEAR) for part in blurred)
        certain = np.clip(denominator / 0.05, 0, 1) * left
        found += certain[..., None] * numerator / np.maximum(denominator, 1e-6)[..., None]
        left = left - certain
        if left.max() < 1e-3:
            break
        step *= 3
    mean = total.sum(axis=(0, 1)) / max(float(share.sum()), 1e-6)
    smoothed: Float32Array = found + left[..., None] * mean.astype(np.float32)
    return smoothed
