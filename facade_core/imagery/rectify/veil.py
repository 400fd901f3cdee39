"""Removal of the purple veil that a bright sky spreads over a picture, by the colour of its dark pixels."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, IntArray, UInt8Array
from facade_core.core.linear_light import linear_to_srgb, smooth_known_light, srgb_to_linear

# Tiles along the width of a picture, at most.
MAX_TILES = 96
MIN_TILE_PIXELS = 16
# Pixels along the side of a tile from which every second is looked at.
MIN_SAMPLED_SIDE = 24
# Share of a tile's pixels that are its dark ones: windows, joints and shade, which are black and grey without a veil.
DARK_SHARE = 0.02
# They have less than this share of the light of the tile's surface, its lit pixels without the sky; else they are its own.
MAX_DARK_RATIO = 0.5
LIT_QUANTILE = 0.9
MAX_SURFACE_GREY = 220
# Linear light by which red and blue exceed green in dark pixels without a veil; twice that is all veil. More than a veil adds
# is a purple thing.
MIN_EXCESS = 0.003
MAX_EXCESS = 0.04
# Linear light of dark pixels without their veil: panes and joints are darker, shaded brick is not.
MAX_BLACK = 0.02
# Veil in red, green and blue per light by which its red and blue exceed its green: slopes of the dark pixels' light, medians
# of the panoramas of the Dam and the IJ.
VEIL_COLOUR = np.array([2.5, 1.5, 3.0], np.float32)
# Rows corrected at once, which bounds memory.
BAND_ROWS = 256


def remove_veil(image: UInt8Array) -> UInt8Array:
    """Subtract the veil in linear light; white stays, and so does a picture with grey dark pixels.

    Neither panes nor joints in the dark have more red and more blue than green. Lens flare has, because coatings reflect
    green least. Tiles whose dark pixels are not black without the veil, such as of purple things or shaded brick, take that of
    the tiles around them.

    Parameters
    ----------
    image : (h, w, 3) uint8 RGB.

    Returns
    -------
    (h, w, 3) uint8.
    """
    import cv2

    side = max(MIN_TILE_PIXELS, -(-image.shape[1] // MAX_TILES))
    excess, is_known = _purple_excess(image, side)
    if not is_known.any():
        return image
    smooth = smooth_known_light(excess[..., None].repeat(3, axis=2), is_known, 1.0)[..., 0]
    veil = smooth * np.clip(smooth / np.float32(MIN_EXCESS) - 1, 0, 1)
    out = image.copy()
    for top in range(0, len(image), BAND_ROWS):
        band = out[top : top + BAND_ROWS]
        # centres of tiles to pixels
        to_tiles = np.array([[1 / side, 0, 0.5 / side - 0.5], [0, 1 / side, (top + 0.5) / side - 0.5]])
        local = cv2.warpAffine(
            veil,
            to_tiles,
            (band.shape[1], band.shape[0]),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        )
        is_veiled = local > 0
        added = local[is_veiled][:, None] * VEIL_COLOUR
        band[is_veiled] = linear_to_srgb((srgb_to_linear(band[is_veiled]) - added) / (1 - added))
    return out


def _purple_excess(image: UInt8Array, side: int) -> tuple[Float32Array, BoolArray]:
    """Return the purple of the dark pixels of each tile (r, c) in linear light, and whether the tile has some."""
    rows, columns = image.shape[0] // side, image.shape[1] // side
    step = max(1, side // MIN_SAMPLED_SIDE)
    excess, is_known = np.zeros((rows, columns), np.float32), np.zeros((rows, columns), bool)
    count = max(1, round(DARK_SHARE * (-(-side // step)) ** 2))
    for row in range(rows):
        band = image[row * side : (row + 1) * side, : columns * side].astype(np.int32)
        # sorted by light; the colour behind it makes the order that of the pixels alone
        keys = (band.sum(axis=2) << 16) | (band[..., 0] << 8) | band[..., 2]
        tiles = keys.reshape(side, columns, -1)[::step, :, ::step]
        pixels = np.sort(tiles.swapaxes(0, 1).reshape(columns, -1), axis=1)
        dark = _light_of_keys(pixels[:, :count]).mean(axis=1)
        below_sky = (pixels >> 16 <= 3 * MAX_SURFACE_GREY).sum(axis=1)
        lit = _light_of_keys(pixels[np.arange(columns), (LIT_QUANTILE * below_sky).astype(np.intp)])
        excess[row] = np.maximum(dark[:, [0, 2]].min(axis=1) - dark[:, 1], 0)
        black = (dark - excess[row][:, None] * VEIL_COLOUR).max(axis=1)
        is_known[row] = (below_sky > count) & (dark.mean(axis=1) < MAX_DARK_RATIO * lit.mean(axis=1))
        is_known[row] &= (excess[row] <= MIN_EXCESS) | (black < MAX_BLACK) & (excess[row] < MAX_EXCESS)
    return excess, is_known


def _light_of_keys(keys: IntArray) -> Float32Array:
    """Return the linear light (..., 3) of pixels as sum, red and blue in one number."""
    red, blue = keys >> 8 & 255, keys & 255
    return srgb_to_linear(np.stack([red, (keys >> 16) - red - blue, blue], axis=-1).astype(np.uint8))
