"""What the forests see: one row of cheap features for each cell of a regular grid over the image.

The paper votes per pixel on 25 x 25 patches (tiles paper, section 4.1); a cell of CELL x CELL pixels stands for its
pixels here, and its surroundings enter through box means, shifted copies and the profiles of its row and column.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from facade_core.core.labels import CLASSES

# Raised whenever a row's meaning changes, so that a model of other features is refused instead of giving nonsense.
FEATURE_VERSION = 1

CELL = 4
_BOXES = (5, 11)
_SHIFTS = (3, 7, 14)
_ROW_SHIFTS = (-14, -7, -3, 3, 7, 14)
# Spread in cells of the Gaussian surrounds that lightness is compared with.
_SURROUNDS = (1.125, 3.0, 7.5)


def appearance(image: np.ndarray) -> np.ndarray:
    """Colour, gradient, texture, position and profile features: (H, W, 3) uint8 RGB -> (h, w, n) float32.

    h and w are H and W divided by CELL, rounded up.
    """
    base = _base_planes(image)
    colour_gradient = base[:5]
    near = _box(colour_gradient, 3)
    wide = [_box(base, size) for size in _BOXES]
    spread = [np.sqrt(np.maximum(_box(base[:3] ** 2, size) - _box(base[:3], size) ** 2, 0)) for size in _BOXES]
    context = [plane for shift in _SHIFTS for plane in _shifted_differences(near, shift)]
    return _rows([base, *wide, *spread, *context, *_profiles(colour_gradient), *_above_and_below(near), *_place(base)])


def context(confidence: np.ndarray, appearance_rows: np.ndarray) -> np.ndarray:
    """Auto-context features of a first vote: (h, w, 7) float32 and its appearance rows -> (h, w, m) float32."""
    vote = np.ascontiguousarray(np.moveaxis(confidence, 2, 0), np.float32)
    height, width = vote.shape[1:]
    near = _box(vote, 3)
    wide = [_box(vote, size) for size in _BOXES]
    shifted = [_shift(near, dy * shift, dx * shift) for shift in _SHIFTS for dy, dx in _DIRECTIONS]
    in_row = np.repeat(vote.mean(2, keepdims=True), width, 2)
    in_column = np.repeat(vote.mean(1, keepdims=True), height, 1)
    rows_around = [_shift(in_row, shift, 0) for shift in _ROW_SHIFTS]
    own = np.moveaxis(appearance_rows, 2, 0)
    return _rows([vote, *wide, *shifted, in_row, in_column, *rows_around, *_above_and_below(vote), own])


APPEARANCE_WIDTH = 9 * 3 + 3 * 2 + 5 * 4 * 3 + 5 * 4 + 5 * 2 + 6 + 5 * 2 + 11
CONTEXT_WIDTH = len(CLASSES) * (1 + 2 + 12 + 2 + 6 + 2) + APPEARANCE_WIDTH

_DIRECTIONS = ((-1, 0), (1, 0), (0, -1), (0, 1))


def _base_planes(image: np.ndarray) -> np.ndarray:
    """L, a, b; gradient across and down; spread of L in the cell; L against three surrounds: (9, h, w)."""
    import cv2

    lab = cv2.cvtColor(image.astype(np.float32) / 255, cv2.COLOR_RGB2Lab)
    light = np.ascontiguousarray(lab[..., 0])
    across = np.abs(cv2.Sobel(light, cv2.CV_32F, 1, 0, ksize=3, borderType=cv2.BORDER_REPLICATE))
    down = np.abs(cv2.Sobel(light, cv2.CV_32F, 0, 1, ksize=3, borderType=cv2.BORDER_REPLICATE))
    mean = _pool(np.stack([*np.moveaxis(lab, 2, 0), across, down, light**2]))
    spread = np.sqrt(np.maximum(mean[5] - mean[0] ** 2, 0))
    against = [mean[0] - ndimage.gaussian_filter(mean[0], sigma, mode="nearest") for sigma in _SURROUNDS]
    return np.stack([*mean[:5], spread, *against])


def _pool(planes: np.ndarray) -> np.ndarray:
    """Mean in each cell: (c, H, W) -> (c, h, w); the last row and column of cells repeat the border."""
    count, height, width = planes.shape
    planes = np.pad(planes, ((0, 0), (0, -height % CELL), (0, -width % CELL)), mode="edge")
    return planes.reshape(count, planes.shape[1] // CELL, CELL, -1, CELL).mean((2, 4), dtype=np.float32)


def _box(planes: np.ndarray, size: int) -> np.ndarray:
    return ndimage.uniform_filter(planes, (0, size, size), mode="nearest")


def _shift(planes: np.ndarray, dy: int, dx: int) -> np.ndarray:
    """The value dy cells below and dx to the right, the border repeated."""
    height, width = planes.shape[1:]
    rows = np.clip(np.arange(height) + dy, 0, height - 1)
    columns = np.clip(np.arange(width) + dx, 0, width - 1)
    return planes[:, rows[:, None], columns]


def _shifted_differences(near: np.ndarray, shift: int) -> list[np.ndarray]:
    return [_shift(near, dy * shift, dx * shift) - near for dy, dx in _DIRECTIONS]


def _profiles(planes: np.ndarray) -> list[np.ndarray]:
    """Mean and spread along the row and the column, the cell against both medians."""
    row, column = planes.mean(2, keepdims=True), planes.mean(1, keepdims=True)
    row_spread, column_spread = planes.std(2, keepdims=True), planes.std(1, keepdims=True)
    against_row = planes[:3] - np.median(planes[:3], 2, keepdims=True)
    against_column = planes[:3] - np.median(planes[:3], 1, keepdims=True)
    full = [np.broadcast_to(plane, planes.shape) for plane in (row, column, row_spread, column_spread)]
    rows_around = [_shift(full[0], shift, 0) for shift in (-7, 7)]
    return [*full, *rows_around, against_row, against_column]


def _above_and_below(planes: np.ndarray) -> list[np.ndarray]:
    """Mean over all cells above (and below) in the column, the own one included: sky has only sky above it."""
    count = np.arange(1, planes.shape[1] + 1, dtype=np.float32)[:, None]
    above = np.cumsum(planes, 1) / count
    below = np.cumsum(planes[:, ::-1], 1)[:, ::-1] / count[::-1]
    return [above, below]


def _place(base: np.ndarray) -> list[np.ndarray]:
    """Position, in shares of the image and in cells, the shape of the image and its mean and spread of colour."""
    height, width = base.shape[1:]
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    x_share = (x + 0.5) / width
    planes = [(y + 0.5) / height, x_share, np.minimum(x_share, 1 - x_share), y, height - 1 - y]
    constant = [*base[:3].mean((1, 2)), *base[:3].std((1, 2))]
    return [np.stack([*planes, *(np.full((height, width), value, np.float32) for value in constant)])]


def _rows(stacks: list[np.ndarray]) -> np.ndarray:
    planes = np.concatenate(stacks)
    return np.ascontiguousarray(np.moveaxis(planes, 0, 2), dtype=np.float32)
