"""Pictures of many planar pieces laid out on few pages, safe to be seen from far: no mip level mixes two pieces."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from facade_core.core.levelling import fill_unknown_colours
from facade_core.geometry.scene import Scene

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
    """Where pieces lie: page, x, y (n,) int64, the first texel inside the gutter; size (n, 2) int64 width and height in
    texels; pages (p, 2) int64, width and height of every page."""

    page: np.ndarray
    x: np.ndarray
    y: np.ndarray
    size: np.ndarray
    pages: np.ndarray


class PbrMaps(NamedTuple):
    """Of a chart at half its texels, (h, w, 3) uint8 each: normals as glTF has them, x right, y up; occlusion, roughness and
    metal; light at night, sRGB, None where it is dark."""

    normal: np.ndarray
    orm: np.ndarray
    emissive: np.ndarray | None


@dataclass(frozen=True)
class PageImages:
    """A page (h, w, 3) uint8, and its maps at half of that where it is lit."""

    base_colour: np.ndarray
    maps: PbrMaps | None = None


def halve_layout(layout: PageLayout) -> PageLayout:
    """A layout of half the texels: pieces and pages begin and end on even texels but for a piece's own end."""
    return PageLayout(layout.page, layout.x // 2, layout.y // 2, (layout.size + 1) // 2, layout.pages // 2)


def lay_out_shelves(size: np.ndarray, group: np.ndarray, *, largest: int = MAX_SHELF_PAGE_TEXELS) -> PageLayout:
    """Put pieces of `size` (n, 2), width and height in texels, on shelves of pages of at most `max_chart_side` square.

    group (n,) ints in rising order of place: pieces of one group lie together, and a page is shared only by groups that follow
    one another. Pages are as small as their pieces allow. A piece and its gutters must fit a page.
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


def _bundle_groups(area: np.ndarray, group: np.ndarray, room: float) -> list[np.ndarray]:
    """Pieces bundled by groups that follow one another, as many as fit a page together."""
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


def _page_width(box: np.ndarray, largest: int) -> int:
    wanted = max(int(box[:, 0].max()), int(np.sqrt(box.prod(axis=1).sum() / EXPECTED_FILL)))
    return min(largest, -(-wanted // (2 * GUTTER_TEXELS)) * 2 * GUTTER_TEXELS)


def fill_between_charts(scene: Scene, page: int, colour: np.ndarray) -> np.ndarray:
    """An atlas page (h, w, 3) with what lies between its charts and their gutters coloured like them, so that mipmaps do not
    bleed."""
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
    layout: PageLayout, page: int, raster: Callable[[int], np.ndarray], gutter: int = GUTTER_TEXELS
) -> np.ndarray:
    """One page (h, w, 3) uint8 with the rasters of its pieces, their borders repeated, and the mean colour between."""
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
        # what is free is black so far; to pick the rest by a mask would take six times the page's memory
        mean = drawn.sum(axis=(0, 1)) / (free.size - np.count_nonzero(free))
        np.copyto(drawn, mean.round().astype(np.uint8), where=free[..., None])
    return drawn


def downscale(image: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """An image (h, w, k) made smaller to size = (width, height), by area."""
    import cv2

    if image.shape[:2] == size[::-1]:
        return image
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA).reshape(size[1], size[0], -1)


def encode_jpeg(image: np.ndarray, quality: int = JPEG_QUALITY) -> bytes:
    """An image (h, w, 3) uint8 RGB as JPEG."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(image).save(buffer, "JPEG", quality=quality)
    return buffer.getvalue()
