"""What somebody corrected of a facade, in place of what was parsed or made up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from facade_core.atlas.provenance import PHOTO
from facade_core.facade import Facade
from facade_core.labels import CLASSES, ELEMENT_CLASSES, WALL
from facade_core.parse import lattice
from facade_core.texture import inpaint
from facade_core.texture.structure import storeys
from facade_core.types import Element, Shares
from facade_core.variation import encode

# A box that moved by less than so many texels is the same; what is drawn anew reaches so far beyond a box.
SAME, RIM = 1.0, 2


def texels_of(boxes: Sequence[Shares], size: tuple[int, int]) -> np.ndarray:
    """The texels (h, w) bool whose middle lies in one of some boxes, for size = (h, w)."""
    mask = np.zeros(size, bool)
    for x0, y0, x1, y1 in boxes:
        mask[_pixels(y0 * size[0], y1 * size[0]), _pixels(x0 * size[1], x1 * size[1])] = True
    return mask


def with_elements(facade: Facade, shares: Sequence[tuple[str, float, float, float, float]], *, seed: int = 0) -> Facade:
    """A facade with these elements in place of its own, which are sure. A photo stays what it shows: where the texture was made
    up and they are others than it has, it is made anew by them.
    """
    height, width = facade.labels.shape
    layout = tuple(Element(label, x0 * width, y0 * height, x1 * width, y1 * height) for label, x0, y0, x1, y1 in shares)
    mask = _changed(facade.elements, layout, (height, width)) & (facade.provenance != PHOTO)
    image = facade.image
    if mask.any() and not mask.all():
        image = inpaint(image, mask, labels=facade.labels, elements=list(layout), method="floors", seed=seed)
    labels = _labels(facade.labels, layout)
    hierarchy = None if facade.hierarchy is None else encode(image, list(layout), seed=seed)
    return replace(
        facade,
        image=image,
        labels=labels,
        lattice=lattice(labels),
        elements=layout,
        hierarchy=hierarchy,
        told=None,
        floors=storeys(labels),
    )


def _changed(before: Sequence[Element], after: Sequence[Element], size: tuple[int, int]) -> np.ndarray:
    """The texels (h, w) bool of elements that only one of two layouts has."""
    mask = np.zeros(size, bool)
    for these, others in ((before, after), (after, before)):
        for e in these:
            if not any(_same(e, other) for other in others):
                mask[_pixels(e.y0 - RIM, e.y1 + RIM), _pixels(e.x0 - RIM, e.x1 + RIM)] = True
    return mask


def _same(a: Element, b: Element) -> bool:
    return a.label == b.label and max(abs(a.x0 - b.x0), abs(a.y0 - b.y0), abs(a.x1 - b.x1), abs(a.y1 - b.y1)) <= SAME


def _labels(labels: np.ndarray, layout: Sequence[Element]) -> np.ndarray:
    """A label map (h, w) uint8 whose elements are those of a layout: what else was one is wall."""
    drawn = labels.copy()
    drawn[np.isin(labels, [CLASSES.index(name) for name in ELEMENT_CLASSES])] = WALL
    for name in ELEMENT_CLASSES:
        for e in layout:
            if e.label == name:
                drawn[_pixels(e.y0, e.y1), _pixels(e.x0, e.x1)] = CLASSES.index(name)
    return drawn


def _pixels(low: float, high: float) -> slice:
    """The pixels whose middle lies within."""
    return slice(max(round(low), 0), max(round(high), 0))
