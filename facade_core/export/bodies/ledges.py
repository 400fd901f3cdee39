"""Ledges of a facade as closed bodies: mouldings of its picture that are lighter than the wall around them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from shapely import Polygon

from facade_core.core.arrays import UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.core.types import Element
from facade_core.export.bodies.balconies import WallFrameFace
from facade_core.export.bodies.mouldings import WallBand, free_wall_mask, split_wall_into_bands
from facade_core.export.bodies.settings import LEDGES

LEDGE_LABEL = "ledge"


def detect_ledges(image: UInt8Array, elements: Sequence[Element], density: float) -> list[Element]:
    """Detect the ledges of a facade as elements of its whole width; all beside its elements is wall.

    Parameters
    ----------
    image : (h, w, 3) uint8 base layer of the facade.
    elements : elements in metres.
    density : texels per metre.
    """
    labels = np.full(image.shape[:2], FacadeClass.WALL, np.uint8)
    free = free_wall_mask(labels, [(e.x0, e.y0, e.x1, e.y1) for e in elements], density)
    bands = split_wall_into_bands(image, free, density)
    width = image.shape[1] / density
    return [
        Element(LEDGE_LABEL, 0.0, band.top, width, band.foot)
        for above, band, below in zip([None, *bands], bands, [*bands[1:], None], strict=False)
        if band.is_moulding
        and LEDGES.min_ledge_height_m <= band.height <= LEDGES.max_ledge_height_m
        and below is not None
        and _is_lighter(band, above, below)
    ]


def _is_lighter(band: WallBand, above: WallBand | None, below: WallBand) -> bool:
    """Return True if a band is lighter than its neighbours; the topmost band has one."""
    light = float(band.colour.mean())
    return all(
        light >= (1 + LEDGES.min_lighter_share) * float(one.colour.mean()) for one in (above, below) if one is not None
    )


def place_ledges(wall: Polygon, elements: Sequence[Element]) -> list[Polygon]:
    """Place the ledges of a wall as rectangles in its chart's frame that cross no other element."""
    _, north, _, south = wall.bounds
    gap = LEDGES.element_clearance_m
    others = [(e.x0 - gap, e.y0 - gap, e.x1 + gap, e.y1 + gap) for e in elements if e.label != LEDGE_LABEL]
    found: list[Polygon] = []
    for ledge in sorted((e for e in elements if e.label == LEDGE_LABEL), key=lambda e: (e.y0, e.x0)):
        top, foot = max(ledge.y0, north), min(ledge.y1, south)
        if foot - top >= LEDGES.min_ledge_height_m:
            found += _ledge_pieces(wall, (top, foot), others)
    return found


def _ledge_pieces(
    wall: Polygon, rows: tuple[float, float], others: Sequence[tuple[float, float, float, float]]
) -> list[Polygon]:
    """Return the rectangles of a ledge between the boxes of other elements that cross its rows."""
    west, _, east, _ = wall.bounds
    top, foot = rows
    # where the wall is lower than the ledge, its end or a gable cuts it
    around = wall.buffer(LEDGES.element_clearance_m / 2)
    crossing = sorted(box for box in others if box[1] < foot and box[3] > top)
    pieces, start = [], west
    for left, _, right, _ in [*crossing, (east, 0, east, 0)]:
        box = shapely.box(start, top, max(start, min(left, east)), foot)
        if left - start >= LEDGES.min_ledge_length_m and around.contains(box):
            pieces.append(box)
        start = max(start, right)
    return pieces


def ledge_faces(box: Polygon) -> list[WallFrameFace]:
    """Build the closed body of a ledge over a rectangle of its wall."""
    x0, y0, x1, y1 = box.bounds
    out = LEDGES.ledge_depth_m

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
