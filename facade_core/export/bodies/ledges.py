"""Ledges of a facade as bodies before their wall: mouldings of its picture that are lighter than the wall above and below."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from shapely import Polygon

from facade_core.core.types import Element
from facade_core.export.bodies.balconies import BalconyFace
from facade_core.export.bodies.mouldings import Band, bands_of, free_of

# A ledge stands out so far; it is so high at least and at most, and so long at least, metres.
DEPTH_M, LOW_M, HIGH_M, SHORT_M = 0.08, 0.08, 0.6, 0.8
# It is lighter than the wall by this share of the wall's light at least.
LIGHTER = 0.06
# It ends so far from openings and balconies, metres.
APART_M = 0.06
LABEL = "ledge"


def ledges_of(image: np.ndarray, labels: np.ndarray, elements: Sequence[Element], density: float) -> list[Element]:
    """The ledges of a facade, image (h, w, 3) uint8 with labels (h, w), both before light fell on it, and its elements in
    metres, as elements of its whole width."""
    free = free_of(labels, [(e.x0, e.y0, e.x1, e.y1) for e in elements], density)
    bands = bands_of(image, free, density)
    width = image.shape[1] / density
    return [
        Element(LABEL, 0.0, band.top, width, band.foot)
        for above, band, below in zip([None, *bands], bands, [*bands[1:], None], strict=False)
        if band.moulding and LOW_M <= band.height <= HIGH_M and below is not None and _stands_out(band, above, below)
    ]


def _stands_out(band: Band, above: Band | None, below: Band) -> bool:
    """Whether a band is lighter than what is beside it; at the wall's top below it alone."""
    light = float(band.colour.mean())
    return all(light >= (1 + LIGHTER) * float(one.colour.mean()) for one in (above, below) if one is not None)


def ledges_on(wall: Polygon, elements: Sequence[Element]) -> list[Polygon]:
    """The ledges of a wall in its chart's frame, as rectangles within it that cross no other element."""
    west, north, east, south = wall.bounds
    others = [
        shapely.box(e.x0 - APART_M, e.y0 - APART_M, e.x1 + APART_M, e.y1 + APART_M)
        for e in elements
        if e.label != LABEL
    ]
    found: list[Polygon] = []
    for ledge in sorted((e for e in elements if e.label == LABEL), key=lambda e: (e.y0, e.x0)):
        top, foot = max(ledge.y0, north), min(ledge.y1, south)
        if foot - top < LOW_M:
            continue
        crossing = [box.bounds for box in others if box.bounds[1] < foot and box.bounds[3] > top]
        # where the wall is lower than the ledge, its end or a gable cuts it
        start = west
        for left, _, right, _ in [*sorted(crossing), (east, 0, east, 0)]:
            box = shapely.box(start, top, max(start, min(left, east)), foot)
            if left - start >= SHORT_M and wall.buffer(APART_M / 2).contains(box):
                found.append(box)
            start = max(start, right)
    return found


def ledge(box: Polygon) -> list[BalconyFace]:
    """The closed body of a ledge over a rectangle of its wall."""
    x0, y0, x1, y1 = box.bounds
    out = DEPTH_M

    def face(corners: list[tuple[float, float, float]], places: list[tuple[float, float]], kind: str) -> BalconyFace:
        return [np.array(corners)], [np.array(places)], kind

    edge = min(out, (y1 - y0) / 2)
    return [
        face(
            [(x0, y1, out), (x1, y1, out), (x1, y0, out), (x0, y0, out)],
            [(x0, y1), (x1, y1), (x1, y0), (x0, y0)],
            "WallSurface",
        ),
        face(
            [(x0, y1, 0), (x0, y1, out), (x0, y0, out), (x0, y0, 0)],
            [(x0 + out, y1), (x0, y1), (x0, y0), (x0 + out, y0)],
            "WallSurface",
        ),
        face(
            [(x1, y1, out), (x1, y1, 0), (x1, y0, 0), (x1, y0, out)],
            [(x1, y1), (x1 - out, y1), (x1 - out, y0), (x1, y0)],
            "WallSurface",
        ),
        face(
            [(x0, y1, 0), (x1, y1, 0), (x1, y1, out), (x0, y1, out)],
            [(x0, y1 - edge), (x1, y1 - edge), (x1, y1), (x0, y1)],
            "OuterCeilingSurface",
        ),
        face(
            [(x0, y0, out), (x1, y0, out), (x1, y0, 0), (x0, y0, 0)],
            [(x0, y0), (x1, y0), (x1, y0 + edge), (x0, y0 + edge)],
            "OuterFloorSurface",
        ),
        face(
            [(x1, y1, 0), (x0, y1, 0), (x0, y0, 0), (x1, y0, 0)],
            [(x1, y1), (x0, y1), (x0, y0), (x1, y0)],
            "WallSurface",
        ),
    ]
