"""Ledges of a facade as closed bodies: mouldings of its picture that are lighter than the wall around them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from shapely import Polygon

from facade_core.core.arrays import UInt8Array
from facade_core.core.types import Element
from facade_core.export.bodies.balconies import WallFrameFace
from facade_core.export.bodies.mouldings import WallBand, free_wall_mask, split_wall_into_bands

# Depth of a ledge, metres.
LEDGE_DEPTH_M = 0.08
# Minimum height of a ledge, metres.
MIN_LEDGE_HEIGHT_M = 0.08
# Maximum height of a ledge, metres.
MAX_LEDGE_HEIGHT_M = 0.6
# Minimum length of a ledge, metres.
MIN_LEDGE_LENGTH_M = 0.8
# Minimum contrast of a ledge to the wall, as share of the wall's light.
MIN_LIGHTER_SHARE = 0.06
# Distance of a ledge from openings and balconies, metres.
ELEMENT_CLEARANCE_M = 0.06
LEDGE_LABEL = "ledge"


def detect_ledges(image: UInt8Array, labels: UInt8Array, elements: Sequence[Element], density: float) -> list[Element]:
    """Detect the ledges of a facade as elements of its whole width.

    Parameters
    ----------
    image : (h, w, 3) uint8 base layer of the facade.
    labels : (h, w) facade classes.
    elements : elements in metres.
    density : texels per metre.
    """
    free = free_wall_mask(labels, [(e.x0, e.y0, e.x1, e.y1) for e in elements], density)
    bands = split_wall_into_bands(image, free, density)
    width = image.shape[1] / density
    return [
        Element(LEDGE_LABEL, 0.0, band.top, width, band.foot)
        for above, band, below in zip([None, *bands], bands, [*bands[1:], None], strict=False)
        if band.is_moulding
        and MIN_LEDGE_HEIGHT_M <= band.height <= MAX_LEDGE_HEIGHT_M
        and below is not None
        and _is_lighter(band, above, below)
    ]


def _is_lighter(band: WallBand, above: WallBand | None, below: WallBand) -> bool:
    """Return True if a band is lighter than its neighbours; the topmost band has one."""
    light = float(band.colour.mean())
    return all(light >= (1 + MIN_LIGHTER_SHARE) * float(one.colour.mean()) for one in (above, below) if one is not None)


def place_ledges(wall: Polygon, elements: Sequence[Element]) -> list[Polygon]:
    """Place the ledges of a wall as rectangles in its chart's frame that cross no other element."""
    west, north, east, south = wall.bounds
    others = [
        shapely.box(
            e.x0 - ELEMENT_CLEARANCE_M,
            e.y0 - ELEMENT_CLEARANCE_M,
            e.x1 + ELEMENT_CLEARANCE_M,
            e.y1 + ELEMENT_CLEARANCE_M,
        )
        for e in elements
        if e.label != LEDGE_LABEL
    ]
    found: list[Polygon] = []
    for ledge in sorted((e for e in elements if e.label == LEDGE_LABEL), key=lambda e: (e.y0, e.x0)):
        top, foot = max(ledge.y0, north), min(ledge.y1, south)
        if foot - top < MIN_LEDGE_HEIGHT_M:
            continue
        crossing = [box.bounds for box in others if box.bounds[1] < foot and box.bounds[3] > top]
        # where the wall is lower than the ledge, its end or a gable cuts it
        start = west
        for left, _, right, _ in [*sorted(crossing), (east, 0, east, 0)]:
            box = shapely.box(start, top, max(start, min(left, east)), foot)
            if left - start >= MIN_LEDGE_LENGTH_M and wall.buffer(ELEMENT_CLEARANCE_M / 2).contains(box):
                found.append(box)
            start = max(start, right)
    return found


def ledge_faces(box: Polygon) -> list[WallFrameFace]:
    """Build the closed body of a ledge over a rectangle of its wall."""
    x0, y0, x1, y1 = box.bounds
    out = LEDGE_DEPTH_M

    def face(corners: list[tuple[float, float, float]], places: list[tuple[float, float]], kind: str) -> WallFrameFace:
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
