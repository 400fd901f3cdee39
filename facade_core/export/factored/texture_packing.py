"""Textures of a factored model: one per repeated grain, and all other pictures on pages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from facade_core.core.arrays import Float64Array, FloatArray, UInt8Array
from facade_core.core.linear_light import linear_to_srgb, srgb_to_linear
from facade_core.core.resizing import resize_image
from facade_core.export.factored.grain_similarity import find_representative_grains
from facade_core.export.factored.image_quilting import WallGrain
from facade_core.export.factored.library import FacadeLibrary
from facade_core.export.factored.wall_geometry import TextureKey, WallPiece, WallPieces
from facade_core.export.models.encoders import MIPMAP_FACTOR
from facade_core.export.models.page_packing import CELL_TEXELS, pack_pages

# Maximum density of an element type where it is largest, texels per metre.
MAX_TYPE_DENSITY = 64.0
# Quantile of vertex light that must fit into 0 to 1; brighter vertices are clipped.
LIGHT_QUANTILE = 0.995
# Quantile of a picture's own light that must not be clipped.
BRIGHTNESS_QUANTILE = 0.995
# Grain of a wall without a known grain.
PLAIN_GRAIN = WallGrain(np.ones((CELL_TEXELS, CELL_TEXELS, 3), np.float32), 1.0)


@dataclass(frozen=True, eq=False)
class PackedTextures:
    """Textures with the placement of every picture.

    Attributes
    ----------
    pictures : (h, w, 3) uint8 textures.
    is_repeated : True for textures that repeat.
    placement : per picture its texture, and its corner and size there as shares.
    gain : brightness factor of each picture over its source.
    scale : scale of each type's picture.
    """

    pictures: list[UInt8Array]
    is_repeated: list[bool]
    placement: dict[TextureKey, tuple[int, Float64Array, Float64Array]]
    gain: dict[TextureKey, float]
    scale: dict[TextureKey, float]

    def texture_lookup(self, key: TextureKey, piece: WallPiece) -> tuple[int, Float64Array, FloatArray]:
        """Return the texture, texture coordinates (v, 2) and vertex colours (v, 3) 0 to 1 of a piece."""
        texture, corner, size = self.placement[key]
        return texture, corner + piece.place * size, np.clip(piece.light / self.gain[key], 0, 1)


def pack_textures(pieces: WallPieces, libraries: Sequence[FacadeLibrary]) -> PackedTextures:
    """Pack the pictures of all pieces; similar grains share a texture."""
    gain: dict[TextureKey, float] = {}
    laid = [key for key in sorted(pieces.by_picture) if key[0] == "grain"]
    flat = [key for key in sorted(pieces.by_picture) if key[0] != "grain"]
    grains = [libraries[number].grains.get(own, PLAIN_GRAIN) for _, number, own in laid]
    shared: dict[int, list[TextureKey]] = {}
    for key, number in zip(laid, find_representative_grains(grains), strict=True):
        shared.setdefault(number, []).append(key)
    pictures: list[UInt8Array] = []
    placement: dict[TextureKey, tuple[int, Float64Array, Float64Array]] = {}
    for representative, keys in shared.items():
        grain = grains[representative]
        # as bright as the brightest wall needs it, so that vertex colours stay within 1
        most = max(_light_quantile(pieces, key) for key in keys)
        limit = 1 / float(np.quantile(grain.relative_light, BRIGHTNESS_QUANTILE))
        light = min(most, limit)
        pictures.append(linear_to_srgb(grain.relative_light * light))
        for key in keys:
            placement[key] = (len(pictures) - 1, np.zeros(2), np.full(2, 1 / grain.width_m))
            gain[key] = light
    repeated = [True] * len(pictures)
    rasters, scale = [], _type_scales(pieces)
    for key in flat:
        picture = _source_picture(libraries, key)
        size = [max(1, round(side * scale.get(key, 1.0))) for side in picture.shape[:2]]
        bright = srgb_to_linear(resize_image(picture, (size[0], size[1])))
        most = 1 / max(float(np.quantile(bright.max(axis=2), BRIGHTNESS_QUANTILE)), 1e-3)
        gain[key] = max(1.0, min(_light_quantile(pieces, key), most))
        rasters.append(linear_to_srgb(bright * gain[key]))
    pages, where = _pack_on_pages(rasters, len(pictures))
    placement |= dict(zip(flat, where, strict=True))
    return PackedTextures(pictures + pages, repeated + [False] * len(pages), placement, gain, scale)


def _type_scales(pieces: WallPieces) -> dict[TextureKey, float]:
    """Return the scale per type that leaves MAX_TYPE_DENSITY where it is largest."""
    least: dict[TextureKey, float] = {}
    for key, density in pieces.elements:
        least[key] = min(density, least.get(key, density))
    return {key: min(1.0, MAX_TYPE_DENSITY / density) for key, density in least.items()}


def _light_quantile(pieces: WallPieces, key: TextureKey) -> float:
    light = np.concatenate([piece.light.max(axis=1) for piece in pieces.by_picture[key]])
    return max(float(np.quantile(light, LIGHT_QUANTILE)), 1e-3)


def _source_picture(libraries: Sequence[FacadeLibrary], key: TextureKey) -> UInt8Array:
    kind, number, own = key
    library = libraries[number]
    return library.types[own].picture if kind == "type" else library.mouldings[own].picture


def _pack_on_pages(
    rasters: Sequence[UInt8Array], first_page: int
) -> tuple[list[UInt8Array], list[tuple[int, Float64Array, Float64Array]]]:
    """Pack rasters with repeated borders on pages; returns the pages, numbered from `first_page`, and the placements."""
    if not rasters:
        return [], []
    size = np.array([raster.shape[1::-1] for raster in rasters], np.int64)
    masks = [np.ones((-(-h // CELL_TEXELS) + 2, -(-w // CELL_TEXELS) + 2), bool) for w, h in size.tolist()]
    layout = pack_pages(masks, size)
    pages = [np.full((height, width, 3), 128, np.uint8) for width, height in layout.pages.tolist()]
    where = []
    for i, raster in enumerate(rasters):
        rows, columns = (side * CELL_TEXELS for side in masks[i].shape)
        h, w = raster.shape[:2]
        padded = np.pad(
            raster,
            [(CELL_TEXELS, rows - h - CELL_TEXELS), (CELL_TEXELS, columns - w - CELL_TEXELS), (0, 0)],
            mode="edge",
        )
        page, x, y = int(layout.page[i]), int(layout.x[i]), int(layout.y[i])
        pages[page][y - CELL_TEXELS : y - CELL_TEXELS + rows, x - CELL_TEXELS : x - CELL_TEXELS + columns] = padded
        corner, span = np.array([x, y]), np.array([w, h])
        where.append((first_page + page, corner / layout.pages[page], span / layout.pages[page]))
    return pages, where


def texture_memory_bytes(pictures: Sequence[UInt8Array]) -> float:
    """Return the graphics memory of pictures with mipmaps, at four bytes per texel."""
    memory: float = sum(image.shape[0] * image.shape[1] for image in pictures) * 4 * MIPMAP_FACTOR
    return memory
