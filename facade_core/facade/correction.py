"""Apply manual corrections of elements to a facade."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.labels import CLASSES, ELEMENT_CLASSES, FacadeClass
from facade_core.core.levelling import fill_unknown_values
from facade_core.core.provenance import Provenance
from facade_core.core.types import Element, Shares
from facade_core.facade.facade import Facade
from facade_core.facade.variation.encoding import encode
from facade_core.parsing.floor_structure import count_floors
from facade_core.parsing.lattice import lattice

# Largest shift of a side, in texels, of an unchanged element.
MAX_SHIFT_TEXELS = 1.0
# Texels by which painted wall extends beyond a removed element.
MIN_RIM_TEXELS = 2
# The same as a share of the element's height, for its sill.
SILL_SHARE = 0.15
# Texels around painted wall that select its source.
CONTEXT_TEXELS = 10


def rasterise_boxes(boxes: Sequence[Shares], size: tuple[int, int]) -> BoolArray:
    """Rasterise boxes to a mask of the texels whose centre is in one of them.

    Parameters
    ----------
    boxes : (x0, y0, x1, y1) as shares of width and height.
    size : (h, w) of the raster.

    Returns
    -------
    (h, w) bool.
    """
    mask = np.zeros(size, bool)
    for x0, y0, x1, y1 in boxes:
        mask[_pixel_slice(y0 * size[0], y1 * size[0]), _pixel_slice(x0 * size[1], x1 * size[1])] = True
    return mask


def replace_elements(facade: Facade, shares: Sequence[tuple[str, float, float, float, float]]) -> Facade:
    """Replace a facade's elements by corrected ones of full confidence.

    Photographed texels stay. In synthetic texels the facade's own wall covers removed elements, and its own elements
    are drawn where elements are added. If the facade shows no element of a class, an added one changes the labels
    only.

    Parameters
    ----------
    shares : label and box (x0, y0, x1, y1) of each element, as shares of width and height.
    """
    height, width = facade.labels.shape
    layout = tuple(Element(label, x0 * width, y0 * height, x1 * width, y1 * height) for label, x0, y0, x1, y1 in shares)
    synthetic = facade.provenance != Provenance.PHOTO
    removed, added = find_unmatched_elements(facade.elements, layout), find_unmatched_elements(layout, facade.elements)
    image = facade.image.copy()
    unchanged = np.zeros((height, width), bool)  # a railing stays in front of a removed window
    for e in facade.elements:
        if e not in removed:
            unchanged[_element_slices(e, 0, (height, width))] = True
    for e in removed:
        _paint_wall(image, facade.labels, e, synthetic & ~unchanged)
    for e in added:
        _paint_element(image, facade, e, synthetic)
    labels = _draw_labels(facade.labels, layout)
    hierarchy = None if facade.hierarchy is None else encode(image, list(layout))
    return replace(
        facade,
        image=image,
        labels=labels,
        lattice=lattice(labels),
        elements=layout,
        hierarchy=hierarchy,
        estimates=None,
        floors=count_floors(labels),
    )


def _paint_wall(image: UInt8Array, labels: UInt8Array, e: Element, synthetic: BoolArray) -> None:
    """Paint the facade's own wall over a removed element, in place.

    The source is the wall patch whose surroundings are most similar; without a free patch the area is diffused.
    """
    import cv2

    height, width = labels.shape
    rows, columns = _element_slices(e, max(MIN_RIM_TEXELS, round(SILL_SHARE * e.height)), (height, width))
    mask = np.zeros((height, width), bool)
    mask[rows, columns] = synthetic[rows, columns]
    if not mask.any():
        return
    outer = tuple(
        slice(max(span.start - CONTEXT_TEXELS, 0), min(span.stop + CONTEXT_TEXELS, end))
        for span, end in ((rows, height), (columns, width))
    )
    ring = np.ones((outer[0].stop - outer[0].start, outer[1].stop - outer[1].start), np.uint8)
    ring[mask[outer]] = 0
    non_wall = cv2.integral((labels != FacadeClass.WALL).astype(np.uint8))
    h, w = ring.shape
    clear = non_wall[h:, w:] - non_wall[:-h, w:] - non_wall[h:, :-w] + non_wall[:-h, :-w] == 0
    if clear.any() and ring.any():
        likeness = cv2.matchTemplate(image, np.ascontiguousarray(image[outer]), cv2.TM_SQDIFF, mask=ring)
        y, x = np.unravel_index(np.where(clear, likeness, np.inf).argmin(), clear.shape)
        piece = image[y : y + h, x : x + w].copy()
    else:
        piece = np.rint(fill_unknown_values(image, ~mask)).astype(np.uint8)[outer]
    image[outer] = np.where(mask[outer][..., None], piece, image[outer])


def _paint_element(image: UInt8Array, facade: Facade, e: Element, synthetic: BoolArray) -> None:
    """Draw the facade's element of this class with the most similar size, in place; nothing if there is none."""
    import cv2

    candidates = [other for other in facade.elements if other.label == e.label and min(other.width, other.height) >= 1]
    if not candidates:
        return
    other = min(
        candidates, key=lambda o: (abs(np.log(o.width / e.width)) + abs(np.log(o.height / e.height)), o.y0, o.x0)
    )
    size = facade.labels.shape
    rows, columns = _element_slices(e, 0, size)
    if rows.stop <= rows.start or columns.stop <= columns.start:
        return
    source = facade.image[_element_slices(other, 0, size)]
    shape = (columns.stop - columns.start, rows.stop - rows.start)
    drawn = cv2.resize(source, shape, interpolation=cv2.INTER_AREA if shape[0] < source.shape[1] else cv2.INTER_LINEAR)
    image[rows, columns] = np.where(synthetic[rows, columns][..., None], drawn, image[rows, columns])


def _element_slices(e: Element, rim: int, size: tuple[int, int]) -> tuple[slice, slice]:
    """Return the rows and columns of an element and a rim around it, in a raster of size (h, w)."""
    y0, y1 = (min(max(round(y), 0), size[0]) for y in (e.y0 - rim, e.y1 + rim))
    x0, x1 = (min(max(round(x), 0), size[1]) for x in (e.x0 - rim, e.x1 + rim))
    return slice(y0, y1), slice(x0, x1)


def find_unmatched_elements(
    elements: Sequence[Element], others: Sequence[Element], *, max_shift: float = MAX_SHIFT_TEXELS
) -> list[Element]:
    """Return the elements without a counterpart of the same class within `max_shift` of every side."""
    return [
        a
        for a in elements
        if not any(
            a.label == b.label
            and max(abs(a.x0 - b.x0), abs(a.y0 - b.y0), abs(a.x1 - b.x1), abs(a.y1 - b.y1)) <= max_shift
            for b in others
        )
    ]


def _draw_labels(labels: UInt8Array, layout: Sequence[Element]) -> UInt8Array:
    """Return a label map (h, w) uint8 whose elements are those of a layout; former elements become wall."""
    drawn = labels.copy()
    drawn[np.isin(labels, [CLASSES.index(name) for name in ELEMENT_CLASSES])] = FacadeClass.WALL
    for name in ELEMENT_CLASSES:
        for e in layout:
            if e.label == name:
                drawn[_pixel_slice(e.y0, e.y1), _pixel_slice(e.x0, e.x1)] = CLASSES.index(name)
    return drawn


def _pixel_slice(low: float, high: float) -> slice:
    """Return the pixels whose centre is in the interval."""
    return slice(max(round(low), 0), max(round(high), 0))
