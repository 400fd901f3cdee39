"""Stains of plaster: painted walls are more even than photographed ones, by what these show at two sizes."""

from __future__ import annotations

import numpy as np

from facade_core.core.labels import FacadeClass
from facade_core.street.materials.patterns import add_noise

# Wavelengths, metres; a band of one is what a Gaussian of the first share of it keeps and one of the second takes away.
BANDS_M, KEEPS, TAKES = (0.7, 2.6), 0.16, 0.32
# Deviation of plain wall in these bands, of its brightness, that a wall is brought to: between what a quarter and what half of
# the rectified photographs that vary least have (`python -m benchmarks.painting`, stains of cmp); at their median the eye sees
# clouds, as photographs also have stucco and shadows there.
PHOTOGRAPHED = (0.0186, 0.0189)
# Cells of noise, metres, and the deviation that a weight of 1 of each gives in each band.
CELLS_M, GIVES = (0.35, 1.3), ((0.146, 0.083), (0.035, 0.15))
# Places to the metre, at which bands are told and stains are worked out.
DENSITY = 8.0
# Within so much of what is no wall its edges are seen; of a place that is wall this much is; places that tell a deviation.
EDGE_M, WHOLE, LEAST = 0.35, 0.99, 150


def deviations(grey: np.ndarray, wall: np.ndarray, density: float) -> tuple[float, ...] | None:
    """How much plain wall differs from place to place in each band, of its mean: half of what lies between its 16th and 84th
    percent. grey (h, w) uint8, wall (h, w) bool, at texels a metre; None where too little is plain."""
    import cv2

    size = [max(1, round(side * DENSITY / density)) for side in wall.shape[::-1]]
    share = cv2.resize(wall.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    light = cv2.resize(np.where(wall, grey, 0).astype(np.float32), size, interpolation=cv2.INTER_AREA)
    reach = 2 * round(EDGE_M * DENSITY) + 1
    known = cv2.erode((share > WHOLE).astype(np.uint8), np.ones((reach, reach), np.uint8)) > 0
    light, share = np.where(known, light / np.maximum(share, WHOLE), 0).astype(np.float32), known.astype(np.float32)
    if known.sum() < LEAST:
        return None
    mean, found = float(light[known].mean()), []
    for band in BANDS_M:
        kept, taken = (
            cv2.GaussianBlur(light, (0, 0), part * band * DENSITY)
            / np.maximum(cv2.GaussianBlur(share, (0, 0), part * band * DENSITY), 1e-6)
            for part in (KEEPS, TAKES)
        )
        low, high = np.percentile((kept - taken)[known] / max(mean, 1.0), (16, 84))
        found.append(float(high - low) / 2)
    return tuple(found)


def weights(own: tuple[float, ...] | None) -> np.ndarray:
    """How much noise (2,) of CELLS_M gives a wall what it lacks of a photographed one's deviations."""
    lacks = np.maximum(np.square(PHOTOGRAPHED) - np.square(own or (0.0, 0.0)), 0.0)
    return np.sqrt(np.maximum(np.linalg.solve(np.square(GIVES).T, lacks), 0.0))


def stains(colour: np.ndarray, labels: np.ndarray, density: float, start: tuple[float, float], seed: int) -> np.ndarray:
    """Tones (rows, columns) float32 about 1 of places of a facade, DENSITY a metre, from half a step within its border.

    colour (h, w, 3) uint8 with labels (h, w) at texels a metre; start: its upper left corner in its plane, metres.
    """
    import cv2

    grey = cv2.cvtColor(np.ascontiguousarray(colour), cv2.COLOR_RGB2GRAY)
    rows, columns = (max(2, int(np.ceil(side / density * DENSITY))) for side in labels.shape)
    step = 1 / DENSITY
    x, y = np.meshgrid(start[0] + step * (np.arange(columns) + 0.5), start[1] + step * (np.arange(rows) + 0.5))
    tone, side = np.ones(rows * columns), np.full(rows * columns, step)
    for number, (cell, weight) in enumerate(
        zip(CELLS_M, weights(deviations(grey, labels == FacadeClass.WALL, density)).tolist(), strict=True)
    ):
        if weight > 0:
            add_noise(x.ravel(), y.ravel(), side, (cell, cell), weight, seed + 121 + number, tone)
    return tone.reshape(rows, columns).astype(np.float32)
