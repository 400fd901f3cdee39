"""What it should cost to take a hidden pixel from elsewhere, from how well rows, columns and surroundings agree."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit
from scipy.ndimage import gaussian_filter1d

UNUSABLE = np.float32(1e4)
# Shares of the three witnesses in a price (near those that fit 150,000 copies on facades with known truth best), and how
# many pixels, or which share of a window, the prior is worth.
_ROW, _COLUMN, _NEAR = 0.4, 0.1, 0.45
_PRIOR_LINE, _PRIOR_NEAR = 40.0, 0.05
# Price, in the image's spread, of a pixel of another class than planned, and of surroundings of other classes.
_WRONG, _WRONG_NEAR = 0.25, 0.25


@dataclass(frozen=True, slots=True)
class Offers:
    """What n hidden pixels could show under k maps: price (k, n) float32, colour (k, n, 3) float32, from UNUSABLE on none."""

    price: np.ndarray
    colour: np.ndarray


def offers(
    image: np.ndarray, known: np.ndarray, hidden: np.ndarray, guide: np.ndarray, maps: np.ndarray, reach: float
) -> Offers:
    """Offers for the pixels hidden (n, 2) of image (H, W, 3) float32, 0-1, under maps (k, 3) as `repeats` gives them.

    A price is the squared colour difference to expect: what the map leaves in the rows and the columns it
    connects and within about `reach` px of the pixel, each drawn towards the image's spread where little is seen;
    guide (H, W) uint8 are class ids that should agree, 255 where none is known.
    """
    spread = 2.0 * float(image[known].var(0).mean())
    price = np.empty((len(maps), len(hidden)), np.float32)
    colour = np.zeros((len(maps), len(hidden), 3), np.float32)
    size = 2 * round(reach) + 1
    for k, (dy, step, mirrored) in enumerate(maps):
        error, seen = _errors(image, known, dy, step, mirrored)
        rows, columns = (_along(error, seen, axis, spread) for axis in (1, 0))
        wrong, told = _disagreements(guide, dy, step, mirrored)
        near = np.float32(_NEAR) * _around(error, seen, size, spread)
        near += np.float32(_WRONG_NEAR * spread) * _around(wrong, told, size, 0.5)
        _offer(
            image, known, guide, hidden, dy, step, mirrored, rows, columns, near, _WRONG * spread, price[k], colour[k]
        )
    return Offers(price, colour)


def _along(error: np.ndarray, seen: np.ndarray, axis: int, spread: float) -> np.ndarray:
    """Mean error of every row (axis 1) or column (axis 0)."""
    total, count = (gaussian_filter1d(of.sum(axis), 2.0, mode="constant") for of in (error, seen))
    return _towards(total, count, _PRIOR_LINE, spread)


def _around(error: np.ndarray, seen: np.ndarray, side: int, spread: float) -> np.ndarray:
    """Mean error about every pixel, in a square window blurred twice."""
    window = side, side
    total, count = (
        cv2.blur(cv2.blur(of, window, borderType=cv2.BORDER_CONSTANT), window, borderType=cv2.BORDER_CONSTANT)
        for of in (error, seen)
    )
    return _towards(total, count, _PRIOR_NEAR, spread)


def _towards(total: np.ndarray, count: np.ndarray, prior: float, spread: float) -> np.ndarray:
    return ((total + prior * spread) / (count + prior)).astype(np.float32)


@njit(cache=True)
def _errors(image, known, dy, step, mirrored):
    height, width = known.shape
    error = np.zeros((height, width), np.float32)
    seen = np.zeros((height, width), np.float32)
    for y in range(max(0, -dy), min(height, height - dy)):
        for x in range(width):
            u = step - x if mirrored else x + step
            if 0 <= u < width and known[y, x] and known[y + dy, u]:
                seen[y, x] = 1.0
                for c in range(3):
                    error[y, x] += (image[y, x, c] - image[y + dy, u, c]) ** 2 / np.float32(3.0)
    return error, seen


@njit(cache=True)
def _disagreements(guide, dy, step, mirrored):
    height, width = guide.shape
    wrong = np.zeros((height, width), np.float32)
    told = np.zeros((height, width), np.float32)
    for y in range(max(0, -dy), min(height, height - dy)):
        for x in range(width):
            u = step - x if mirrored else x + step
            if 0 <= u < width and guide[y, x] != 255 and guide[y + dy, u] != 255:
                told[y, x] = 1.0
                wrong[y, x] = guide[y, x] != guide[y + dy, u]
    return wrong, told


@njit(cache=True)
def _offer(image, known, guide, hidden, dy, step, mirrored, rows, columns, near, wrong, price, colour):
    height, width = known.shape
    for n in range(len(hidden)):
        y, x = hidden[n, 0], hidden[n, 1]
        v, u = y + dy, step - x if mirrored else x + step
        if v < 0 or v >= height or u < 0 or u >= width or not known[v, u]:
            price[n] = UNUSABLE
            continue
        for c in range(3):
            colour[n, c] = image[v, u, c]
        price[n] = _ROW * rows[y] + _COLUMN * columns[x] + near[y, x]
        if guide[y, x] != 255 and guide[v, u] != 255 and guide[y, x] != guide[v, u]:
            price[n] += wrong
