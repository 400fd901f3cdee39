"""The pictures of a factored model: grains that are repeated, each a texture, and all else together on pages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from facade_core.export.packing import CELL, pack_pages
from facade_core.factored.library import Library
from facade_core.factored.light import linear, srgb
from facade_core.factored.wall import Key, Piece, Pieces

# A picture is made so light that this share of what multiplies it is no more than one; the rest is as light as it gets.
LIT = 0.995
# And no lighter than that this share of its own light is kept.
KEPT = 0.995


@dataclass(frozen=True, eq=False)
class Shown:
    """Pictures (h, w, 3) uint8, which of them are repeated, and where each key's picture lies: its texture, then the corner
    and the size of its place there, shares of it; gain: how much lighter it is than it was."""

    pictures: list[np.ndarray]
    repeated: list[bool]
    place: dict[Key, tuple[int, np.ndarray, np.ndarray]]
    gain: dict[Key, float]

    def laid(self, key: Key, piece: Piece) -> tuple[int, np.ndarray, np.ndarray]:
        """Of a piece: its texture, its texture coordinates (v, 2) and vertex colours (v, 3), 0 to 1."""
        texture, corner, size = self.place[key]
        return texture, corner + piece.place * size, np.clip(piece.light / self.gain[key], 0, 1)


def pictures_of(pieces: Pieces, libraries: Sequence[Library]) -> Shown:
    """The pictures of all that was laid; grains that are one object are one picture."""
    gain: dict[Key, float] = {}
    grains: dict[int, list[Key]] = {}
    flat: list[Key] = []
    for key in sorted(pieces.by_picture):
        if key[0] != "grain":
            flat.append(key)
        else:
            grains.setdefault(id(libraries[key[1]].grains.get(key[2])), []).append(key)
    pictures: list[np.ndarray] = []
    place: dict[Key, tuple[int, np.ndarray, np.ndarray]] = {}
    for keys in grains.values():
        grain = libraries[keys[0][1]].grains.get(keys[0][2], np.ones((CELL, CELL, 3), np.float32))
        # as light as the lightest wall wants it, so that vertex colours stay within 1
        most = max(_wanted(pieces, key) for key in keys)
        limit = 1 / float(np.quantile(grain, KEPT))
        light = min(most, limit)
        pictures.append(srgb(grain * light))
        for key in keys:
            place[key] = (len(pictures) - 1, np.zeros(2), np.ones(2))
            gain[key] = light
    repeated = [True] * len(pictures)
    rasters = []
    for key in flat:
        bright = linear(_picture(libraries, key))
        most = 1 / max(float(np.quantile(bright.max(axis=2), KEPT)), 1e-3)
        gain[key] = max(1.0, min(_wanted(pieces, key), most))
        rasters.append(srgb(bright * gain[key]))
    pages, where = _on_pages(rasters, [len(pictures)])
    place |= dict(zip(flat, where, strict=True))
    return Shown(pictures + pages, repeated + [False] * len(pages), place, gain)


def _wanted(pieces: Pieces, key: Key) -> float:
    light = np.concatenate([piece.light.max(axis=1) for piece in pieces.by_picture[key]])
    return max(float(np.quantile(light, LIT)), 1e-3)


def _picture(libraries: Sequence[Library], key: Key) -> np.ndarray:
    kind, number, own = key
    library = libraries[number]
    return library.types[own].picture if kind == "type" else library.mouldings[own].picture


def _on_pages(
    rasters: Sequence[np.ndarray], before: Sequence[int]
) -> tuple[list[np.ndarray], list[tuple[int, np.ndarray, np.ndarray]]]:
    """Rasters on pages with their borders repeated around them; and where each lies, half a texel within it."""
    if not rasters:
        return [], []
    size = np.array([raster.shape[1::-1] for raster in rasters], np.int64)
    masks = [np.ones((-(-h // CELL) + 2, -(-w // CELL) + 2), bool) for w, h in size.tolist()]
    layout = pack_pages(masks, size)
    pages = [np.full((height, width, 3), 128, np.uint8) for width, height in layout.pages.tolist()]
    where = []
    for i, raster in enumerate(rasters):
        rows, columns = (side * CELL for side in masks[i].shape)
        h, w = raster.shape[:2]
        padded = np.pad(raster, [(CELL, rows - h - CELL), (CELL, columns - w - CELL), (0, 0)], mode="edge")
        page, x, y = int(layout.page[i]), int(layout.x[i]), int(layout.y[i])
        pages[page][y - CELL : y - CELL + rows, x - CELL : x - CELL + columns] = padded
        corner, span = np.array([x, y]), np.array([w, h])
        where.append((before[0] + page, corner / layout.pages[page], span / layout.pages[page]))
    return pages, where


def held(pictures: Sequence[np.ndarray]) -> int:
    """Bytes that pictures take of a graphics card: four a texel, and a third more for their mipmaps."""
    return sum(image.shape[0] * image.shape[1] for image in pictures) * 16 // 3
