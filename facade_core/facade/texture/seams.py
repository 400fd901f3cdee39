"""Join a cloned patch to its surroundings: path of the seam and diffusion of colour differences."""

from __future__ import annotations

import cv2
import numpy as np

from facade_core.core.arrays import Float32Array, Float64Array, Int64Array
from facade_core.core.numba_cache import njit


@njit(cache=True)
def find_min_error_path(error: Float64Array) -> Int64Array:
    """Find the path of least error along the first axis, with steps of at most 1 (minimum-error cut).

    Parameters
    ----------
    error : (n, k) float64.

    Returns
    -------
    (n,) int64 index along the second axis.
    """
    length, wide = error.shape
    total = error.copy()
    for a in range(1, length):
        for b in range(wide):
            best = total[a - 1, b]
            if b > 0:
                best = min(best, total[a - 1, b - 1])
            if b + 1 < wide:
                best = min(best, total[a - 1, b + 1])
            total[a, b] += best
    path = np.empty(length, np.int64)
    for a in range(length - 1, -1, -1):
        if a == length - 1:
            path[a] = np.argmin(total[a])
            continue
        b = path[a + 1]
        for other in (b - 1, b + 1):
            if 0 <= other < wide and total[a, other] < total[a, b]:
                b = other
        path[a] = b
    return path


def diffuse_difference(difference: Float32Array, weight: Float32Array) -> Float32Array:
    """Diffuse colour differences known on a rim over the whole patch.

    A membrane by normalised convolution: near the rim its local mean, farther off the mean over an ever wider part of
    it. Differences are clipped, so that one misplaced edge does not bleed into the patch.

    Parameters
    ----------
    difference : (h, w, 3), valid where weight is positive.
    weight : (h, w).

    Returns
    -------
    (h, w, 3) float32.
    """
    weight = weight.astype(np.float32)
    clipped = np.asarray(np.clip(difference, -48.0, 48.0) * weight[..., None], np.float32)
    extent = float(max(difference.shape[:2]))
    sums, shares = np.zeros_like(clipped), np.zeros_like(weight)
    for sigma, share in ((4.0, 1.0), (16.0, 0.1), (max(48.0, extent / 2), 0.01)):
        sums += share * _blur(clipped, sigma)
        shares += share * _blur(weight, sigma)
    return np.asarray(sums / np.maximum(shares, 1e-6)[..., None], np.float32)


def _blur(array: Float32Array, sigma: float) -> Float32Array:
    """Blur by a Gaussian; large sigmas shrink the array first; zero outside."""
    factor = max(1, int(sigma // 4))
    height, width = array.shape[:2]
    small = cv2.resize(array, (-(-width // factor), -(-height // factor)), interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(small, (0, 0), sigma / factor, borderType=cv2.BORDER_CONSTANT)
    return np.asarray(cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR), array.dtype)
