"""Large pictures in parts that a network takes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np


def split_tiles(image: np.ndarray, side: int, overlap: int) -> Iterator[tuple[np.ndarray, int, int]]:
    """Parts (h, w, 3) of an image, at most `side` wide and high, which overlap by at least `overlap` pixels, and the column and
    row at which each begins."""
    for y in _starts(image.shape[0], side, overlap):
        for x in _starts(image.shape[1], side, overlap):
            yield image[y : y + side, x : x + side], x, y


def _starts(length: int, side: int, overlap: int) -> list[int]:
    count = max(1, -(-(length - overlap) // (side - overlap)))
    return np.linspace(0, max(0, length - side), count).round().astype(int).tolist()
