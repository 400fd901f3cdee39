"""Facade at a finer raster: its layout as it is, and the detail of pictures in its photographed texels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from facade_core.core.arrays import AnyArray, BoolArray, Float32Array, UInt8Array
from facade_core.core.provenance import Provenance
from facade_core.core.types import Lattice
from facade_core.facade.facade import Facade
from facade_core.facade.variation.encoding import encode

# Largest factor of a texel's detail, and its inverse the smallest.
MAX_DETAIL = 2.0
# Grey levels that are added to both sides of the ratio, so that noise in the dark is no detail.
DETAIL_FLOOR = 6.0
# Texels that the low-pass reaches to each side.
LOW_PASS_TEXELS = 6
# Texels over which detail fades in, inside the photographed part.
FADE_TEXELS = 2


def picture_detail(rgb: UInt8Array, seen: BoolArray, coarse: UInt8Array, scale: float) -> Float32Array:
    """Compute the detail of a picture that a coarser raster cannot hold: each texel over that of the coarse one, enlarged.

    A low-pass of the picture itself is smoother than the coarse raster. Detail over it would count noise twice.

    Parameters
    ----------
    rgb : (h, w, 3) uint8.
    seen : (h, w) bool texels that the picture shows; others, and texels next to them, have no detail.
    coarse : (height, width, 3) the picture at the coarser raster.
    scale : texels per texel of the coarser raster.

    Returns
    -------
    (h, w, 3) float32, 1 without detail.
    """
    import cv2

    low = enlarge_image(coarse, (rgb.shape[0], rgb.shape[1]), scale)
    detail = (rgb + np.float32(DETAIL_FLOOR)) / (low + np.float32(DETAIL_FLOOR))
    detail = np.clip(detail, np.float32(1 / MAX_DETAIL), np.float32(MAX_DETAIL))
    side = 2 * LOW_PASS_TEXELS + 1
    is_whole = cv2.erode(seen.astype(np.uint8), np.ones((side, side), np.uint8)) > 0
    return np.where(is_whole[..., None], detail, np.float32(1))


def sharpen_facade(facade: Facade, detail: Float32Array, scale: float) -> Facade:
    """Bring a facade to the raster of its pictures' detail, which is applied where it is photographed.

    Parameters
    ----------
    detail : (h, w, 3) float32 as of `picture_detail`.
    scale : texels of `detail` per texel of the facade; both rasters begin at the same corner.
    """
    height, width = size = (int(detail.shape[0]), int(detail.shape[1]))
    provenance = enlarge_classes(facade.provenance, size, scale)
    photo = provenance == Provenance.PHOTO
    factor = 1 + _fade_in(photo)[..., None] * (detail - 1)
    image = _apply(enlarge_image(facade.image, size, scale), factor)
    # interpolation mixes what stands before the facade into photographed texels beside it
    evidence = np.where(photo[..., None], image, enlarge_image(facade.evidence, size, scale))

    def scale_x(x: float) -> float:
        return min(x * scale, width)

    def scale_y(y: float) -> float:
        return min(y * scale, height)

    elements = tuple(
        replace(one, x0=scale_x(one.x0), x1=scale_x(one.x1), y0=scale_y(one.y0), y1=scale_y(one.y1))
        for one in facade.elements
    )
    return replace(
        facade,
        evidence=evidence,
        image=image,
        labels=enlarge_classes(facade.labels, size, scale),
        occluded=enlarge_classes(facade.occluded, size, scale),
        provenance=provenance,
        masked=tuple(
            (round(scale_x(x0)), round(scale_y(y0)), round(scale_x(x1)), round(scale_y(y1)))
            for x0, y0, x1, y1 in facade.masked
        ),
        lattice=Lattice(
            (*(round(scale_y(row)) for row in facade.lattice.rows[:-1]), height),
            (*(round(scale_x(column)) for column in facade.lattice.columns[:-1]), width),
        ),
        elements=elements,
        hierarchy=None if facade.hierarchy is None else encode(image, elements),
    )


def enlarge_image(image: UInt8Array, size: tuple[int, int], scale: float) -> UInt8Array:
    """Return a raster (h, w, ...) from the same corner at (height, width), with `scale` texels per texel: bicubic."""
    import cv2

    return _warp(image, size, scale, cv2.INTER_CUBIC)


def enlarge_classes(raster: AnyArray, size: tuple[int, int], scale: float) -> AnyArray:
    """Return numbers or a mask (h, w) from the same corner at (height, width): of the nearest texel."""
    import cv2

    return _warp(raster.astype(np.uint8), size, scale, cv2.INTER_NEAREST).astype(raster.dtype)


def _warp(raster: UInt8Array, size: tuple[int, int], scale: float, interpolation: int) -> UInt8Array:
    import cv2

    shift = 0.5 / scale - 0.5
    inverse = np.array([[1 / scale, 0.0, shift], [0.0, 1 / scale, shift]])
    flags = interpolation | cv2.WARP_INVERSE_MAP
    return np.asarray(
        cv2.warpAffine(raster, inverse, size[::-1], flags=flags, borderMode=cv2.BORDER_REPLICATE), np.uint8
    )


def _apply(raster: UInt8Array, factor: Float32Array) -> UInt8Array:
    sharpened = (raster + np.float32(DETAIL_FLOOR)) * factor - np.float32(DETAIL_FLOOR)
    return np.asarray(np.clip(np.rint(sharpened), 0, 255), np.uint8)


def _fade_in(photo: BoolArray) -> Float32Array:
    """Return the share of detail (h, w): 1 inside the photographed texels, falling to 0 at their border."""
    import cv2

    side = 2 * FADE_TEXELS + 1
    inside = cv2.erode(photo.astype(np.float32), np.ones((side, side), np.uint8))
    return np.asarray(cv2.blur(inside, (side, side)), np.float32)
