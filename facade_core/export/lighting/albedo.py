"""Removal of low-frequency shading from wall pictures."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Float32Array, FloatArray, NumericArray, UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.export.lighting.settings import ALBEDO


def estimate_shading(colour: UInt8Array, labels: UInt8Array, density: float) -> Float32Array | None:
    """Estimate the shading of a wall along its width.

    A parabola is fitted to the log brightness of cells, relative to the mean of their row, by iteratively reweighted least
    squares. Only the horizontal direction is used: vertically, a dark plinth cannot be separated from shade.

    Parameters
    ----------
    colour : (h, w, 3) uint8.
    labels : (h, w) facade classes.
    density : texels per metre.

    Returns
    -------
    (h, w) float32 around 1; None where too little wall is visible.
    """
    side = max(1, round(ALBEDO.cell_m * density))
    rows, columns = labels.shape[0] // side, labels.shape[1] // side
    cells = (rows, side, columns, side)
    grey = colour.mean(axis=2)[: rows * side, : columns * side].reshape(cells)
    wall = (labels == FacadeClass.WALL)[: rows * side, : columns * side].reshape(cells)
    mostly = wall.mean(axis=(1, 3)) > 0.5 if rows and columns else np.zeros((0, 0), bool)
    if mostly.sum() < ALBEDO.min_cells:
        return None
    values = np.where(wall, grey, np.nan).transpose(0, 2, 1, 3)[mostly].reshape(int(mostly.sum()), -1)
    light = np.log(np.maximum(np.nanmedian(values, axis=1), 1))
    row, column = np.nonzero(mostly)
    scale = labels.shape[1] / 2
    place = ((column + 0.5) * side - scale) / scale
    parts, weight = np.column_stack([place, place**2]), np.ones(len(light))
    for _ in range(ALBEDO.robust_rounds):
        # relative to the mean of each row, so that differences between rows are not taken for light
        row_weight = np.maximum(np.bincount(row, weight, rows), 1e-9)
        basis = parts - np.column_stack([np.bincount(row, weight * part, rows) / row_weight for part in parts.T])[row]
        relative = light - (np.bincount(row, weight * light, rows) / row_weight)[row]
        penalty = ALBEDO.regularisation * weight.sum() * np.eye(2)
        found = np.linalg.solve(basis.T @ (basis * weight[:, None]) + penalty, basis.T @ (weight * relative))
        weight = 1 / (1 + ((relative - basis @ found) / ALBEDO.robust_scale) ** 2)
    along = (np.arange(labels.shape[1]) + 0.5 - scale) / scale
    field = np.exp(found[0] * along + found[1] * (along**2 - 1 / 3))  # whose logarithm is 0 in the mean
    return np.broadcast_to(np.clip(field, ALBEDO.min_shading, ALBEDO.max_shading).astype(np.float32), labels.shape)


def divide_light(colour: NumericArray, light: FloatArray) -> UInt8Array:
    """Divide the light out of a colour.

    Parameters
    ----------
    colour : (h, w, 3) in 0..255.
    light : (h, w) or (h, w, 3) factor.

    Returns
    -------
    (h, w, 3) uint8.
    """
    wide = light if light.ndim == 3 else light[..., None]
    return (
        np.minimum(colour / np.maximum(wide, np.float32(0.05)) + np.float32(0.5), max(ALBEDO.max_albedo, 1))
    ).astype(np.uint8)
