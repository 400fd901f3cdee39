"""Features of windows from which their states are learnt: brightness and colour relative to the wall, edges, symmetry."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Float32Array, Float64Array

# Changes with the features, so that a model of others is refused.
FEATURES_VERSION = 1
# Lengths of the parts of the features, in their order.
FEATURE_BLOCKS = (32, 8, 8, 8, 32, 32, 12, 8, 7, 7, 7, 7, 24, 12, 9, 5)
# Size to which patches are resampled, rows and columns.
_ROWS = 24
_COLUMNS = 16
# Grey levels added to ratios, so that noise in the dark does not count.
_DARK = 16.0
# Percentiles of brightness and colour over the window, and over a quarter.
_PERCENTILES = (5, 15, 30, 50, 70, 85, 95)
_QUARTER_PERCENTILES = (15, 50, 85)


def compute_window_features(patches: Float32Array, wall: float) -> Float64Array:
    """Compute the features of the windows of one size group.

    Each feature is given twice: by itself, and relative to the group's median, which removes the frame, the exposure and
    the colour of the light.

    Parameters
    ----------
    patches : (N, h, w, 3) intensities with the light of the wall removed.
    wall : usual brightness of the wall in the patches' intensities.

    Returns
    -------
    (N, d).
    """
    import cv2

    small = np.stack([cv2.resize(p, (_COLUMNS, _ROWS), interpolation=cv2.INTER_AREA) for p in patches])
    grey = small.mean(axis=3)
    light = grey / wall
    warmth = (small[..., 0] - small[..., 2]) / (grey + _DARK)
    green = (small[..., 1] - (small[..., 0] + small[..., 2]) / 2) / (grey + _DARK)
    saturation = (small.max(axis=3) - small.min(axis=3)) / (small.max(axis=3) + _DARK)
    sharp = patches.mean(axis=3)
    across, down = (_edge_strength(sharp, wall, axis) for axis in ((1, 0), (0, 1)))
    features = [
        _pool(_log_ratio(grey, wall), 8, 4),
        *(_pool(v, 4, 2) for v in (warmth, green, saturation)),
        *(_pool(v, 8, 4) for v in (across, down)),
        _pool(light, 12, 1),
        _pool(light, 1, 8),
        *(_percentiles(v, 1, 1, _PERCENTILES) for v in (light, warmth, green, saturation)),
        _percentiles(light, 4, 2, _QUARTER_PERCENTILES),
        _colour_of_panes(light, warmth, green),
        *(_asymmetry(v) for v in (light, warmth, across)),
        _stripes(light),
    ]
    flat: Float64Array = np.concatenate(features, axis=1).astype(np.float64)
    return np.concatenate([flat, flat - np.median(flat, axis=0)], axis=1)


def _log_ratio(grey: Float32Array, wall: float) -> Float32Array:
    """Return the logarithm of brightness to the wall's; rounded from double precision, it is the same on all processors."""
    return np.asarray(np.log(((grey + _DARK) / (wall + _DARK)).astype(np.float64)), np.float32)


def _edge_strength(grey: Float32Array, wall: float, axis: tuple[int, int]) -> Float32Array:
    """Return the (N, rows, columns) gradients along an axis at full resolution, averaged, as a root share of the wall."""
    import cv2

    strength = [np.abs(cv2.Sobel(g, -1, *axis, scale=1 / 8)) for g in grey]
    small = np.stack([cv2.resize(s, (_COLUMNS, _ROWS), interpolation=cv2.INTER_AREA) for s in strength])
    strengths: Float32Array = np.sqrt(small / np.float32(wall))
    return strengths


def _cells(values: Float32Array, rows: int, columns: int) -> Float32Array:
    """Return the (N, rows * columns, n) values of each cell."""
    number, height, width = values.shape
    cells = values.reshape(number, rows, height // rows, columns, width // columns)
    gathered: Float32Array = cells.transpose(0, 1, 3, 2, 4).reshape(number, rows * columns, -1)
    return gathered


def _pool(values: Float32Array, rows: int, columns: int) -> Float32Array:
    means: Float32Array = _cells(values, rows, columns).mean(axis=2)
    return means


def _percentiles(values: Float32Array, rows: int, columns: int, shares: tuple[int, ...]) -> Float32Array:
    ordered = np.sort(_cells(values, rows, columns), axis=2)
    at = np.array(shares) / 100 * (ordered.shape[2] - 1)
    below = np.floor(at).astype(int)
    low, high = ordered[..., below], ordered[..., np.minimum(below + 1, ordered.shape[2] - 1)]
    found: Float32Array = (low + (high - low) * (at - below)).reshape(len(values), -1).astype(np.float32)
    return found


def _colour_of_panes(light: Float32Array, warmth: Float32Array, green: Float32Array) -> Float32Array:
    """Return brightness, its spread and the colour of the darker half of each third: the panes without their frame."""
    cells = [_cells(v, 3, 1) for v in (light, warmth, green)]
    order = np.argsort(cells[0], axis=2, kind="stable")[..., : cells[0].shape[2] // 2]
    dark = [np.take_along_axis(c, order, axis=2) for c in cells]
    return np.concatenate([*(d.mean(axis=2) for d in dark), dark[0].std(axis=2)], axis=1)


def _asymmetry(values: Float32Array) -> Float32Array:
    """Return how far the left half differs from the mirrored right one, over thirds of the height."""
    return _pool(np.abs(values - values[..., ::-1]), 3, 1)


def _stripes(light: Float32Array) -> Float32Array:
    """Return the contrast of rows, of columns and of the middle column with their surroundings: slats, folds, mullion."""
    inner = light[:, 2:-2, 2:-2]
    profiles = inner.mean(axis=2), inner.mean(axis=1)
    contrast = [np.abs(p[:, 1:-1] - (p[:, :-2] + p[:, 2:]) / 2).mean(axis=1) for p in profiles]
    middle = light[:, :, 7:9].mean(axis=2) - light[:, :, (3, 4, 11, 12)].mean(axis=2)
    return np.concatenate([np.stack(contrast, axis=1), middle.reshape(len(light), 3, -1).mean(axis=2)], axis=1)
