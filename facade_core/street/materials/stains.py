"""Stains of plaster: painted walls are more even than photographed ones, by what these show at two sizes."""

from __future__ import annotations

import numpy as np

from facade_core.core.labels import FacadeClass
from facade_core.street.materials.patterns import add_noise

# Wavelengths, metres; a band of one is what a Gaussian of the first share of it keeps and one of the second takes away.
BANDS_M, KEPT_SIGMA, REMOVED_SIGMA = (0.7, 2.6), 0.16, 0.32
# Deviation of plain wall in these bands, of its brightness, that a wall is brought to: between what a quarter and what half of
# the rectified photographs that vary least have (`python -m benchmarks.painting`, stains of cmp); at their median the eye sees
# clouds, as photographs also have stucco and shadows there.
PHOTO_DEVIATIONS = (0.0186, 0.0189)
# Cells of noise, metres, and the deviation that a weight of 1 of each gives in each band.
NOISE_CELLS_M, NOISE_DEVIATIONS = (0.35, 1.3), ((0.146, 0.083), (0.035, 0.15))
# Places to the metre, at which bands are told and stains are worked out.
STAIN_DENSITY = 8.0
# Within so much of what is no wall its edges are seen; of a place that is wall this much is; places that tell a deviation.
EDGE_MARGIN_M, MIN_WALL_SHARE, MIN_PLACES = 0.35, 0.99, 150


def wall_deviations(grey: np.ndarray, wall: np.ndarray, density: float) -> tuple[float, ...] | None:
    """How much plain wall differs from place to place in each band, of its mean: half of what lies between its 16th and 84th
    percent. grey (h, w) uint8, wall (h, w) bool, at texels a metre; None where too little is plain."""
    import cv2

    size = [max(1, round(side * STAIN_DENSITY / density)) for side in wall.shape[::-1]]
    share = cv2.resize(wall.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    light = cv2.resize(np.where(wall, grey, 0).astype(np.float32), size, interpolation=cv2.INTER_AREA)
    reach = 2 * round(EDGE_MARGIN_M * STAIN_DENSITY) + 1
    known = cv2.erode((share > MIN_WALL_SHARE).astype(np.uint8), np.ones((reach, reach), np.uint8)) > 0
    light, share = np.where(known, light / np.maximum(share, MIN_WALL_SHARE), 0).astype(np.float32), known.astype(np.float32)
    if known.sum() < MIN_PLACES:
        return None
    mean, found = float(light[known].mean()), []
    for band in BANDS_M:
        kept, taken = (
            cv2.GaussianBlur(light, (0, 0), part * band * STAIN_DENSITY)
            / np.maximum(cv2.GaussianBlur(share, (0, 0), part * band * STAIN_DENSITY), 1e-6)
            for part in (KEPT_SIGMA, REMOVED_SIGMA)
        )
        low, high = np.percentile((kept - taken)[known] / max(mean, 1.0), (16, 84))
        found.append(float(high - low) / 2)
    return tuple(found)


def stain_weights(deviations: tuple[float, ...] | None) -> np.ndarray:
    """How much noise (2,) of NOISE_CELLS_M gives a wall what it lacks of a photographed one's deviations."""
    lacks = np.maximum(np.square(PHOTO_DEVIATIONS) - np.square(deviations or (0.0, 0.0)), 0.0)
    return np.sqrt(np.maximum(np.linalg.solve(np.square(NOISE_DEVIATIONS).T, lacks), 0.0))


def stain_tones(colour: np.ndarray, labels: np.ndarray, density: float, start: tuple[float, float], seed: int) -> np.ndarray:
    """Tones (rows, columns) float32 about 1 of places of a facade, STAIN_DENSITY a metre, from half a step within its border.

    colour (h, w, 3) uint8 with labels (h, w) at texels a metre; start: its upper left corner in its plane, metres.
    """
    import cv2

    grey = cv2.cvtColor(np.ascontiguousarray(colour), cv2.COLOR_RGB2GRAY)
    rows, columns = (max(2, int(np.ceil(side / density * STAIN_DENSITY))) for side in labels.shape)
    step = 1 / STAIN_DENSITY
    x, y = np.meshgrid(start[0] + step * (np.arange(columns) + 0.5), start[1] + step * (np.arange(rows) + 0.5))
    tone, side = np.ones(rows * columns), np.full(rows * columns, step)
    for number, (cell, weight) in enumerate(
        zip(NOISE_CELLS_M, stain_weights(wall_deviations(grey, labels == FacadeClass.WALL, density)).tolist(), strict=True)
    ):
        if weight > 0:
            add_noise(x.ravel(), y.ravel(), side, (cell, cell), weight, seed + 121 + number, tone)
    return tone.reshape(rows, columns).astype(np.float32)
