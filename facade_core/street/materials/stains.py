"""Stains of plaster: variation at two scales that painted walls lack against photographs."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.street.materials.patterns import add_noise

# Wavelengths of the bands. A band is the difference of two Gaussians, with sigmas as shares of its wavelength.
BANDS_M = (0.7, 2.6)
KEPT_SIGMA = 0.16
REMOVED_SIGMA = 0.32
# Target deviation of plain wall in each band, relative to its brightness: between the first quartile and the median of
# rectified photographs of CMP. At the median walls look cloudy, because photographs also contain stucco and shadows.
PHOTO_DEVIATIONS = (0.0186, 0.0189)
NOISE_CELLS_M = (0.35, 1.3)
# Deviation in each band per weight of each noise.
NOISE_DEVIATIONS = ((0.146, 0.083), (0.035, 0.15))
# Samples per metre.
STAIN_DENSITY = 8.0
# Margin around other classes, whose edges would count as variation.
EDGE_MARGIN_M = 0.35
# Share of wall in a sample that counts as wall.
MIN_WALL_SHARE = 0.99
# Samples that are needed for a deviation.
MIN_PLACES = 150


def wall_brightness_deviations(grey: UInt8Array, wall: BoolArray, density: float) -> tuple[float, ...] | None:
    """Compute the relative variation of plain wall in each band.

    It is half the span from the 16th to the 84th percentile.

    Parameters
    ----------
    grey : (h, w) uint8.
    wall : (h, w) bool.
    density : texels per metre.

    Returns
    -------
    One deviation per band; None if too little wall is plain.
    """
    import cv2

    size = [max(1, round(side * STAIN_DENSITY / density)) for side in wall.shape[::-1]]
    share = cv2.resize(wall.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    light = cv2.resize(np.where(wall, grey, 0).astype(np.float32), size, interpolation=cv2.INTER_AREA)
    reach = 2 * round(EDGE_MARGIN_M * STAIN_DENSITY) + 1
    known = cv2.erode((share > MIN_WALL_SHARE).astype(np.uint8), np.ones((reach, reach), np.uint8)) > 0
    light, share = (
        np.where(known, light / np.maximum(share, MIN_WALL_SHARE), 0).astype(np.float32),
        known.astype(np.float32),
    )
    if known.sum() < MIN_PLACES:
        return None
    mean, deviations = float(light[known].mean()), []
    for band in BANDS_M:
        kept, removed = (
            cv2.GaussianBlur(light, (0, 0), part * band * STAIN_DENSITY)
            / np.maximum(cv2.GaussianBlur(share, (0, 0), part * band * STAIN_DENSITY), 1e-6)
            for part in (KEPT_SIGMA, REMOVED_SIGMA)
        )
        low, high = np.percentile((kept - removed)[known] / max(mean, 1.0), (16, 84))
        deviations.append(float(high - low) / 2)
    return tuple(deviations)


def stain_weights(deviations: tuple[float, ...] | None) -> Float64Array:
    """Compute the noise weights (2,) that raise a wall's deviations to those of photographs."""
    lacks = np.maximum(np.square(PHOTO_DEVIATIONS) - np.square(deviations or (0.0, 0.0)), 0.0)
    return np.sqrt(np.maximum(np.linalg.solve(np.square(NOISE_DEVIATIONS).T, lacks), 0.0))


def stain_tones(
    colour: UInt8Array, labels: UInt8Array, density: float, start: tuple[float, float], seed: int
) -> Float32Array:
    """Compute the tones of stains on a facade.

    Parameters
    ----------
    colour : (h, w, 3) uint8.
    labels : (h, w) class id.
    density : texels per metre.
    start : upper left corner of the facade in its plane, metres.
    seed : random seed.

    Returns
    -------
    (rows, columns) float32 about 1, STAIN_DENSITY per metre, half a step inside the border.
    """
    import cv2

    grey = np.asarray(cv2.cvtColor(np.ascontiguousarray(colour), cv2.COLOR_RGB2GRAY), np.uint8)
    rows, columns = (max(2, int(np.ceil(side / density * STAIN_DENSITY))) for side in labels.shape)
    step = 1 / STAIN_DENSITY
    x, y = np.meshgrid(start[0] + step * (np.arange(columns) + 0.5), start[1] + step * (np.arange(rows) + 0.5))
    tone, side = np.ones(rows * columns), np.full(rows * columns, step)
    for number, (cell, weight) in enumerate(
        zip(
            NOISE_CELLS_M,
            stain_weights(wall_brightness_deviations(grey, labels == FacadeClass.WALL, density)).tolist(),
            strict=True,
        )
    ):
        if weight > 0:
            add_noise(x.ravel(), y.ravel(), side, (cell, cell), weight, seed + 121 + number, tone)
    return tone.reshape(rows, columns).astype(np.float32)
