"""Floor height and bay width of a partly hidden facade (floors paper, section 3.1, Code 1)."""

from __future__ import annotations

import cv2
import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, UInt8Array
from facade_core.core.levelling import fill_unknown_values
from facade_core.core.ties import first_maximum

RANSAC_ITERATIONS = 400
_MAX_SLOPE = np.tan(np.deg2rad(4.0))
_LINE_TOLERANCE_PX = 2.0  # of a shifted line that meets a line
_PEAK_RADIUS_PX = 8  # in which a shift must be the best one
_MIN_PITCH_PX = 12
_MIN_CORRELATION = 0.15  # of a repetition


def estimate_floor_height(image: UInt8Array, mask: BoolArray, rng: np.random.Generator) -> int | None:
    """Estimate the floor height by RANSAC over near-horizontal lines of the visible part.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    mask : (H, W) bool, True where hidden.
    rng : draws pairs of lines.

    Returns
    -------
    Pixels, None without repetition.
    """
    image = _fill_hole(image, mask)
    return _find_pitch(_horizontal_lines(image, mask), image, mask, rng)


def estimate_bay_width(image: UInt8Array, mask: BoolArray, rng: np.random.Generator) -> int | None:
    """Estimate the spacing of window columns from near-vertical lines.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    mask : (H, W) bool, True where hidden.
    rng : draws pairs of lines.

    Returns
    -------
    Pixels, None without repetition.
    """
    turned = np.ascontiguousarray(_fill_hole(image, mask).transpose(1, 0, 2))
    return _find_pitch(_horizontal_lines(turned, mask.T), turned, mask.T, rng)


def _fill_hole(image: UInt8Array, mask: BoolArray) -> UInt8Array:
    """Return the image with hidden pixels diffused, since edges and blurs reach into a hole."""
    return np.where(mask[..., None], np.rint(fill_unknown_values(image, ~mask)).astype(np.uint8), image)


def _horizontal_lines(image: UInt8Array, mask: BoolArray) -> Float64Array:
    """Return lines (n, 3), y, x0, x1, that are near horizontal, long enough, and not the hole's outline."""
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    edges = cv2.Canny(grey, 50, 120)
    edges[cv2.dilate(mask.astype(np.uint8), np.ones((7, 7), np.uint8)) > 0] = 0
    shortest = max(8, image.shape[1] // 25)
    cv2.setRNGSeed(0)
    found = cv2.HoughLinesP(edges, 1, np.pi / 360, 20, minLineLength=shortest, maxLineGap=3)
    if found is None:
        return np.empty((0, 3))
    x0, y0, x1, y1 = found.reshape(-1, 4).astype(float).T
    level = np.abs(y1 - y0) <= _MAX_SLOPE * np.abs(x1 - x0)
    lines: Float64Array = np.stack([(y0 + y1) / 2, np.minimum(x0, x1), np.maximum(x0, x1)], 1)[level]
    return lines


def _find_pitch(lines: Float64Array, image: UInt8Array, mask: BoolArray, rng: np.random.Generator) -> int | None:
    """Return the shift between two random lines under which most lines meet lines (Code 1).

    Lines that leave do not count, nor those that come as near to the border as lines are placed: no edge is found there.
    Lines are inexact by pixels. So the picture's correlation with itself has its best value near the lines' shift, and the
    result is the nearest shift where it peaks.
    """
    height = image.shape[0]
    if len(lines) < 4:
        return None
    y, x0, x1 = lines.T
    pairs = rng.integers(0, len(lines), (RANSAC_ITERATIONS, 2))
    shifts = np.unique(np.rint(np.abs(y[pairs[:, 0]] - y[pairs[:, 1]])))
    shifts = shifts[(shifts >= max(_MIN_PITCH_PX, height / 16)) & (shifts <= height / 3)]
    if not len(shifts):
        return None
    inner = height - 1 - _LINE_TOLERANCE_PX
    overlap = (x0[:, None] < x1[None]) & (x0[None] < x1[:, None])
    length = x1 - x0
    share = np.zeros(len(shifts))
    for k, shift in enumerate(shifts):
        meets = (overlap & (np.abs(y[:, None] + shift - y[None]) <= _LINE_TOLERANCE_PX)).any(1)
        stays = y + shift < inner
        share[k] = (length * meets)[stays].sum() / max(length[stays].sum(), 1.0)
        share[k] *= min(1.0, length[stays].sum() / (0.4 * length.sum()))
    correlation = _shift_correlations(image, mask, height // 3 + _PEAK_RADIUS_PX)
    steps = np.arange(-int(_LINE_TOLERANCE_PX), int(_LINE_TOLERANCE_PX) + 1)
    likeness = correlation[shifts.astype(int)[:, None] + steps].max(axis=1)
    score = np.maximum(likeness, 0.0) * (0.5 + share)
    peak = score >= np.where(np.abs(shifts[:, None] - shifts) <= _PEAK_RADIUS_PX, score, 0.0).max(1)
    best = int(np.flatnonzero(peak & (score >= 0.75 * score.max()))[0])  # the fundamental, not its multiples
    if likeness[best] < _MIN_CORRELATION:
        return None
    pitch = int(shifts[best])
    while _MIN_PITCH_PX <= pitch < len(correlation) - 1:
        step = first_maximum(correlation[[pitch, pitch - 1, pitch + 1]])
        if step == 0:
            return pitch
        pitch += (0, -1, 1)[step]
    return None  # the correlation only falls from shift 0, or rises to the end


def _shift_correlations(image: UInt8Array, mask: BoolArray, count: int) -> Float64Array:
    """Return the correlation of the visible detail with itself, at a quarter of the width, for shifts of 0 to `count` - 1."""
    small = max(1, image.shape[1] // 4), image.shape[0]
    grey = cv2.resize(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), small, interpolation=cv2.INTER_AREA).astype(np.float32)
    known = cv2.resize(mask.astype(np.float32), small, interpolation=cv2.INTER_AREA) == 0
    weight = cv2.blur(known.astype(np.float32), (9, 2 * (image.shape[0] // 16) + 1))
    local = cv2.blur(grey * known, (9, 2 * (image.shape[0] // 16) + 1)) / np.maximum(weight, 1e-6)
    detail = np.where(known, cv2.GaussianBlur(grey - local, (0, 0), 3.0), 0.0)
    out = np.ones(count)
    for shift in range(1, count):
        both = known[:-shift] & known[shift:]
        a, b = detail[:-shift][both], detail[shift:][both]
        if len(a) >= 50:
            out[shift] = float((a * b).sum()) / max(float(np.sqrt((a * a).sum() * (b * b).sum())), 1e-6)
    return out
