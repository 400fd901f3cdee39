"""Texture pages of many planar pieces, laid out so that no mip level mixes two pieces."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from facade_core.core.arrays import Int64Array, UInt8Array
from facade_core.core.levelling import fill_unknown_colours
from facade_core.geometry.scene import Scene

Texel = TypeVar("Texel", np.uint8, np.float32)

# Width of the repeated border of a piece, texels; pieces start on multiples of it. Down to the mip level of an eighth,
# no interpolated texel and no block of a JPEG's luma mixes two pieces.
GUTTER_TEXELS = 8
# Maximum side of a page, texels.
MAX_SHELF_PAGE_TEXELS = 4096
# Quality of JPEG, 0 to 100.
JPEG_QUALITY = 90
# Share of a page that shelves are expected to fill.
EXPECTED_FILL = 0.85


@dataclass(frozen=True)
class PageLayout:
    """Positions of pieces on pages.

    Attributes
    ----------
    page : (n,) page of each piece.
    x, y : (n,) first texel inside the gutter.
    size : (n, 2) width and height of each piece in texels.
    pages : (p, 2) width and height of each page in texels.
    """

    page: Int64Array
    x: Int64Array
    y: Int64Array
    size: Int64Array
    pages: Int64Array


class PbrMaps(NamedTuple):
    """Maps of a chart at half its texels, (h, w, 3) uint8 each.

    Attributes
    ----------
    normal : tangent-space normals as in glTF, x right and y up.
    orm : occlusion, roughness and metalness.
    emissive : light at night, sRGB; None where dark.
    """

    normal: UInt8Array
    orm: UInt8Array
    emissive: UInt8Array | None


@dataclass(frozen=True)
class PageImages:
    """Images of a page: base colour (h, w, 3) uint8, and maps at half its size if it is relit."""

    base_colour: UInt8Array
    maps: PbrMaps | None = None


def halve_layout(layout: PageLayout) -> PageLayout:
    """Return the layout of the maps, at half the texels."""
    return PageLayout(layout.page, layout.x // 2, layout.y // 2, (layout.size + 1) // 2, layout.pages // 2)


def lay_out_shelves(size: Int64Array, group: Int64Array, *, largest: int = MAX_SHELF_PAGE_TEXELS) -> PageLayout:
    """Lay out pieces on shelves of pages of at most `largest` texels square.

    Pages are as small as their pieces allow. A piece and its gutters must fit a page.

    Parameters
    ----------
    size : (n, 2) width and height in texels.
    group : (n,) groups in spatial order; a group stays together, and only consecutive groups share a page.
    largest : maximum side of a page, texels.
    """
    box = -(-(size + 2 * GUTTER_TEXELS) // GUTTER_TEXELS) * GUTTER_TEXELS
    n = len(size)
    page, x, y = (np.zeros(n, np.int64) for _ in range(3))
    pages: list[tuple[int, int]] = []
    for members in _bundle_groups(box.prod(axis=1), group, EXPECTED_FILL * largest**2):
        width = _page_width(box[members], largest)
        order = members[np.lexsort((members, -box[members, 0], -box[members, 1]))]
        left, top, shelf = 0, 0, 0
        used = 0
        for i in order.tolist():
            w, h = int(box[i, 0]), int(box[i, 1])
            if left + w > width:
                left, top, shelf = 0, top + shelf, 0
            if top + h > largest:
                pages.append((width, used))
                left, top, shelf = 0, 0, 0
            page[i], x[i], y[i] = len(pages), left + GUTTER_TEXELS, top + GUTTER_TEXELS
            left, shelf = left + w, max(shelf, h)
            used = top + shelf
        pages.append((width, used))
    return PageLayout(page, x, y, size, np.array(pages, np.int64).reshape(-1, 2))


def _bundle_groups(area: Int64Array, group: Int64Array, room: float) -> list[Int64Array]:
    """Bundle pieces of consecutive groups, as many as fit one page."""
    groups, of = np.unique(group, return_inverse=True)
    total = np.bincount(of, area, minlength=len(groups))
    bundle = np.zeros(len(groups), np.int64)
    filled = 0.0
    for i in range(len(groups)):
        filled += total[i]
        if filled > room and filled > total[i]:
            bundle[i:] += 1
            filled = total[i]
    order = np.argsort(bundle[of], kind="stable")
    return np.split(order, np.flatnonzero(np.diff(bundle[of][order])) + 1) if len(order) else []


def _page_width(box: Int64Array, largest: int) -> int:
    wanted = max(int(box[:, 0].max()), int(np.sqrt(box.prod(axis=1).sum() / EXPECTED_FILL)))
    return min(largest, -(-wanted // (2 * GUTTER_TEXELS)) * 2 * GUTTER_TEXELS)


def fill_between_charts(scene: Scene, page: int, colour: UInt8Array) -> UInt8Array:
    """Fill an atlas page between its charts with their colours, so that mipmaps do not bleed.

    Parameters
    ----------
    scene : the scene with the placement of its charts.
    page : number of the page.
    colour : (h, w, 3) the page.
    """
    owned = np.zeros(colour.shape[:2], bool)
    placement, gutter = scene.placement, scene.spec.gutter
    for chart in np.flatnonzero(placement.page == page).tolist():
        y, x = int(placement.y[chart]) - gutter, int(placement.x[chart]) - gutter
        height, width = (int(side[chart]) + 2 * gutter for side in (placement.height, placement.width))
        owned[y : y + height, x : x + width] = True
    if owned.any() and not owned.all():
        colour = fill_unknown_colours(colour, owned)
    return colour


def draw_page(
    layout: PageLayout, page: int, raster: Callable[[int], UInt8Array], gutter: int = GUTTER_TEXELS
) -> UInt8Array:
    """Draw a page from the rasters of its pieces, with repeated borders and the mean colour between.

    Parameters
    ----------
    layout : positions of the pieces.
    page : number of the page.
    raster : returns the raster (h, w, 3) uint8 of a piece.
    gutter : texels of border around each piece.

    Returns
    -------
    (height, width, 3) uint8.
    """
    width, height = layout.pages[page].tolist()
    drawn = np.zeros((height, width, 3), np.uint8)
    free = np.ones((height, width), bool)
    for i in np.flatnonzero(layout.page == page).tolist():
        image = raster(i)
        w, h = layout.size[i].tolist()
        right, below = (-(side + 2 * gutter) % gutter + gutter for side in (w, h))
        padded = np.pad(image, [(gutter, below), (gutter, right), (0, 0)], mode="edge")
        top, left = int(layout.y[i]) - gutter, int(layout.x[i]) - gutter
        place = (slice(top, top + padded.shape[0]), slice(left, left + padded.shape[1]))
        drawn[place] = padded
        free[place] = False
    if free.any() and not free.all():
        # free texels are still black; selecting the others by a mask would take six times the memory of the page
        mean = drawn.sum(axis=(0, 1)) / (free.size - np.count_nonzero(free))
        np.copyto(drawn, mean.round().astype(np.uint8), where=free[..., None])
    return drawn


def downscale(image: NDArray[Texel], size: tuple[int, int]) -> NDArray[Texel]:
    """Downscale an image by area averaging.

    Parameters
    ----------
    image : (h, w, k) image.
    size : (width, height) of the result.
    """
    import cv2

    if image.shape[:2] == size[::-1]:
        return image
    smaller = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), image.dtype)
    return smaller.reshape(size[1], size[0], -1)


def encode_jpeg(image: UInt8Array) -> bytes:
    """Encode an RGB image (h, w, 3) uint8 as JPEG."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(image).save(buffer, "JPEG", quality=JPEG_QUALITY)
    return buffer.getvalue()
