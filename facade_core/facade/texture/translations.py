"""Translations and mirror images under which the visible part of a facade repeats itself."""

from __future__ import annotations

import cv2
import numpy as np
from scipy import fft

from facade_core.core.arrays import AnyArray, BoolArray, Float32Array, Int64Array
from facade_core.facade.texture.settings import INPAINTING


def find_repeat_translations(grey: Float32Array, known: BoolArray) -> Int64Array:
    """Find translations and reflections of highest normalised correlation, the strongest first within each kind.

    A pixel (y, x) is taken from (y + dy, x + step), if mirrored from (y + dy, step - x).

    Parameters
    ----------
    grey : (H, W) float32 detail of mean 0.
    known : (H, W) bool.

    Returns
    -------
    (n, 3) int64 dy, step, mirrored (0 or 1).
    """
    height, width = known.shape
    score = _trusted_correlation(grey, known, grey, known)
    dy, dx = np.mgrid[-height + 1 : height, -width + 1 : width]
    score[(np.abs(dy) < INPAINTING.min_shift_px) & (np.abs(dx) < INPAINTING.min_shift_px)] = -1.0
    level, steep = np.abs(dy) <= INPAINTING.axis_tolerance_px, np.abs(dx) <= INPAINTING.axis_tolerance_px
    kinds = ((level, INPAINTING.max_axial), (steep, INPAINTING.max_axial), (~level & ~steep, INPAINTING.max_oblique))
    ahead = np.concatenate([_find_peaks(np.where(kind, score, -1.0), count) for kind, count in kinds])
    mirror = _trusted_correlation(grey, known, grey[:, ::-1], known[:, ::-1])
    axes = _find_peaks(np.where(level, mirror, -1.0), INPAINTING.max_oblique)
    axes[:, 1] = width - 1 - axes[:, 1]
    found = [np.column_stack([at, np.full(len(at), kind)]) for kind, at in enumerate((ahead, axes))]
    return np.unique(np.concatenate(found), axis=0)


def _trusted_correlation(a: Float32Array, known_a: BoolArray, b: Float32Array, known_b: BoolArray) -> Float32Array:
    """Return the correlation weighted by the overlap; -1 where the overlap is too small."""
    height, width = a.shape
    score, seen = correlate_masked(a, known_a, b, known_b)
    # A long translation has a small overlap, which is more likely to fit by chance.
    trust = np.clip(seen / (0.25 * height * width), 0, 1) ** 0.25
    return np.where(seen > INPAINTING.min_overlap_share * height * width, score * trust, -1.0)


def correlate_masked(
    a: Float32Array, known_a: BoolArray, b: Float32Array, known_b: BoolArray
) -> tuple[Float32Array, Float32Array]:
    """Return the normalised correlation of a at p with b at p + t over pixels known in both, for all t.

    Parameters
    ----------
    a, b : (H, W) float32 of mean 0.
    known_a, known_b : (H, W) bool.

    Returns
    -------
    Correlation and number of pixels, (2 H - 1, 2 W - 1) each, t = 0 in the middle.
    """
    height, width = a.shape
    shape = [fft.next_fast_len(2 * n - 1, real=True) for n in (height, width)]

    def forward(array: AnyArray) -> AnyArray:
        spectrum: AnyArray = fft.rfft2(array.astype(np.float32), shape)
        return spectrum

    def correlate(first: AnyArray, second: AnyArray) -> Float32Array:
        whole = fft.irfft2(np.conj(first) * second, shape)
        correlation: Float32Array = np.roll(whole, (height - 1, width - 1), (0, 1))[: 2 * height - 1, : 2 * width - 1]
        return correlation

    ma, mb = forward(known_a), forward(known_b)
    product = correlate(forward(a * known_a), forward(b * known_b))
    squares = correlate(forward(a**2 * known_a), mb), correlate(ma, forward(b**2 * known_b))
    seen = correlate(ma, mb)
    norm = np.sqrt(np.maximum(squares[0], 0) * np.maximum(squares[1], 0))
    return product / np.maximum(norm, 1e-3 * norm.max() + 1e-9), seen


def _find_peaks(score: Float32Array, count: int) -> Int64Array:
    """Return (n, 2) dy, dx of the highest local maxima."""
    height, width = (side // 2 for side in score.shape)
    top = (score == cv2.dilate(score, np.ones((7, 7), np.uint8))) & (score > -1.0)
    at = np.argwhere(top)
    best = np.argsort(-score[top], kind="stable")[:count]
    offsets: Int64Array = at[best] - (height, width)
    return offsets
