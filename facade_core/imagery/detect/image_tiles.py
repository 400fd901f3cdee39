"""Overlapping tiles of large pictures."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from facade_core.core.arrays import UInt8Array


def split_tiles(image: UInt8Array, side: int, overlap: int) -> Iterator[tuple[UInt8Array, int, int]]:
    """Split an image into overlapping tiles.

    Parameters
    ----------
    image : (H, W, 3).
    side : largest width and height of a tile in pixels.
    overlap : smallest overlap in pixels.

    Yields
    ------
    Tile (h, w, 3), and its first column and row.
    """
    for y in _tile_starts(image.shape[0], side, overlap):
        for x in _tile_starts(image.shape[1], side, overlap):
            yield image[y : y + side, x : x + side], x, y


def _tile_starts(length: int, side: int, overlap: int) -> list[int]:
    count = max(1, -(-(length - overlap) // (side - overlap)))
    starts: list[int] = np.linspace(0, max(0, length - side), count).round().astype(int).tolist()
    return starts
