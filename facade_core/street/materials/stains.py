"""Stains of plaster: variation at two scales that painted walls lack against photographs.

Water runs down below sills, balconies and the top of a wall, and splashes its foot: stains are there, and are upright.
"""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, UInt8Array
from facade_core.core.fixed_order import solve_least_squares
from facade_core.core.labels import FacadeClass
from facade_core.street.materials.patterns import add_noise
from facade_core.street.materials.settings import STAINS


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

    size = [max(1, round(side * STAINS.stain_density / density)) for side in wall.shape[::-1]]
    share = cv2.resize(wall.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    light = cv2.resize(np.where(wall, grey, 0).astype(np.float32), size, interpolation=cv2.INTER_AREA)
    reach = 2 * round(STAINS.edge_margin_m * STAINS.stain_density) + 1
    known = cv2.erode((share > STAINS.min_wall_share).astype(np.uint8), np.ones((reach, reach), np.uint8)) > 0
    light, share = (
        np.where(known, light / np.maximum(share, STAINS.min_wall_share), 0).astype(np.float32),
        known.astype(np.float32),
    )
    if known.sum() < STAINS.min_places:
        return None
    mean, deviations = float(light[known].mean()), []
    for band in STAINS.bands_m:
        kept, removed = (
            cv2.GaussianBlur(light, (0, 0), part * band * STAINS.stain_density)
            / np.maximum(cv2.GaussianBlur(share, (0, 0), part * band * STAINS.stain_density), 1e-6)
            for part in (STAINS.kept_sigma, STAINS.removed_sigma)
        )
        low, high = np.percentile((kept - removed)[known] / max(mean, 1.0), (16, 84))
        deviations.append(float(high - low) / 2)
    return tuple(deviations)


def stain_weights(deviations: tuple[float, ...] | None) -> Float64Array:
    """Compute the noise weights (2,) that raise a wall's deviations to those of photographs."""
    lacks = np.maximum(np.square(STAINS.photo_deviations) - np.square(deviations or (0.0, 0.0)), 0.0)
    weights = solve_least_squares(np.square(STAINS.noise_deviations).T, lacks[:, None])[:, 0]
    return np.sqrt(np.maximum(weights, 0.0))


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
    (rows, columns) float32 about 1, `stain_density` per metre, half a step inside the border.
    """
    import cv2

    grey = np.asarray(cv2.cvtColor(np.ascontiguousarray(colour), cv2.COLOR_RGB2GRAY), np.uint8)
    rows, columns = (max(2, int(np.ceil(side / density * STAINS.stain_density))) for side in labels.shape)
    step = 1 / STAINS.stain_density
    x, y = np.meshgrid(start[0] + step * (np.arange(columns) + 0.5), start[1] + step * (np.arange(rows) + 0.5))
    tone, side = np.zeros(rows * columns), np.full(rows * columns, step)
    for number, (cell, weight) in enumerate(
        zip(
            STAINS.noise_cells_m,
            stain_weights(wall_brightness_deviations(grey, labels == FacadeClass.WALL, density)).tolist(),
            strict=True,
        )
    ):
        if weight > 0:
            add_noise(x.ravel(), y.ravel(), side, cell, weight, seed + 121 + number, tone)
    return (1 + tone.reshape(rows, columns) * stain_strengths(labels, (rows, columns))).astype(np.float32)


def stain_strengths(labels: UInt8Array, size: tuple[int, int]) -> Float64Array:
    """Compute how strongly each place of a wall is stained: strongest below elements and the top, and at the foot.

    Parameters
    ----------
    labels : (h, w) class id.
    size : rows and columns of the result, `stain_density` per metre.

    Returns
    -------
    Strengths of that size; the mean of their squares on the wall is 1, but for the limit.
    """
    import cv2

    is_wall = cv2.resize(labels, size[::-1], interpolation=cv2.INTER_NEAREST) == FacadeClass.WALL
    below, step = np.zeros(size), 1 / STAINS.stain_density
    for row in range(1, size[0]):
        below[row] = np.where(is_wall[row], below[row - 1] + step, 0.0)
    above = step * np.arange(size[0], 0, -1)[:, None]
    strength = STAINS.even_share + np.exp(-below / STAINS.run_m) + np.exp(-above / STAINS.splash_m)
    squares = np.square(strength[is_wall]) if is_wall.any() else np.ones(1)
    return np.asarray(np.minimum(strength / np.sqrt(squares.mean()), STAINS.max_strength))
