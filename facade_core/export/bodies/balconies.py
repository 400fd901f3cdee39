"""Balconies of a layout as closed bodies before their wall, textured by the picture of the wall."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely
from shapely import Polygon

from facade_core.core.arrays import Float64Array
from facade_core.core.types import Element
from facade_core.export.bodies.settings import BALCONY_SHAPES

# A face in the frame of its wall: rings (k, 3) in metres right, down and outward; the places (k, 2) on the wall
# whose texture it shows; and its semantic type.
WallFrameFace = tuple[list[Float64Array], list[Float64Array], str]


def place_balconies(wall: Polygon, elements: Sequence[Element]) -> list[tuple[Element, Polygon]]:
    """Return the balconies of a wall with disjoint rectangles in its chart's frame."""
    found: list[tuple[Element, Polygon]] = []
    wanted = [e for e in elements if e.label == "balcony"]
    for element in sorted(wanted, key=lambda e: (-e.width * e.height, e.x0, e.y0)):
        west, north, east, south = wall.bounds
        box = shapely.box(max(element.x0, west), max(element.y0, north), min(element.x1, east), min(element.y1, south))
        x0, y0, x1, y1 = box.bounds if not box.is_empty else (0.0, 0.0, 0.0, 0.0)
        if min(x1 - x0, y1 - y0) < BALCONY_SHAPES.min_balcony_m or not wall.buffer(
            BALCONY_SHAPES.railing_thickness_m
        ).contains(box):
            continue
        if not any(box.intersects(other) for _, other in found):
            found.append((element, box))
    return found


def extend_windows_behind_railings(elements: Sequence[Element]) -> list[Element]:
    """Extend windows whose foot is hidden by a balcony down to its floor.

    The parse labels the railing as balcony, but people step out through the opening behind it. Only windows between
    the ends of the railing, or hardly wider, are extended.
    """
    found = []
    bounds = [(e.x0, e.y0, e.x1, e.y1) for e in elements if e.label == "balcony"]
    for element in elements:
        for x0, y0, x1, y1 in bounds if element.label == "window" else ():
            floor = balcony_floor(y0, y1) - BALCONY_SHAPES.sill_above_floor_m
            between = (
                x0 - BALCONY_SHAPES.max_beside_railing_m <= element.x0
                and element.x1 <= x1 + BALCONY_SHAPES.max_beside_railing_m
            )
            if between and element.y0 < y0 and y0 - BALCONY_SHAPES.max_above_railing_m <= element.y1 < floor:
                element = replace(element, y1=floor)
        found.append(element)
    return found


def balcony_floor(y0: float, y1: float) -> float:
    """Return the row of the floor of a balcony from `y0` down to `y1`, metres."""
    return y1 - min(BALCONY_SHAPES.floor_thickness_m, (y1 - y0) / 3)


def balcony_faces(box: Polygon, far: float) -> list[WallFrameFace]:
    """Build the closed body of a balcony over a rectangle of its wall: outer sides, rim, inner sides and floor.

    Parameters
    ----------
    box : rectangle in the chart's frame.
    far : depth of the balcony, metres.

    Returns
    -------
    Faces; the last is the one against the wall.
    """
    x0, y0, x1, y1 = box.bounds
    floor = balcony_floor(y0, y1)
    a, b, c = (
        x0 + BALCONY_SHAPES.railing_thickness_m,
        x1 - BALCONY_SHAPES.railing_thickness_m,
        far - BALCONY_SHAPES.railing_thickness_m,
    )

    def face(corners: list[tuple[float, float, float]], kind: str, side: str = "") -> WallFrameFace:
        return [np.array(corners)], [_texture_places(corners, side, (x0, y0, x1, y1), floor)], kind

    faces = [
        face([(x0, y1, far), (x1, y1, far), (x1, y0, far), (x0, y0, far)], "WallSurface", "front"),
        face([(x0, y1, 0), (x0, y1, far), (x0, y0, far), (x0, y0, 0)], "WallSurface", "left"),
        face([(x1, y1, far), (x1, y1, 0), (x1, y0, 0), (x1, y0, far)], "WallSurface", "right"),
        face([(x0, y1, 0), (x1, y1, 0), (x1, y1, far), (x0, y1, far)], "OuterCeilingSurface", "level"),
        face([(a, floor, 0), (a, floor, c), (b, floor, c), (b, floor, 0)], "OuterFloorSurface", "level"),
        face([(b, floor, c), (a, floor, c), (a, y0, c), (b, y0, c)], "WallSurface", "front"),
        face([(a, floor, c), (a, floor, 0), (a, y0, 0), (a, y0, c)], "WallSurface", "left"),
        face([(b, floor, 0), (b, floor, c), (b, y0, c), (b, y0, 0)], "WallSurface", "right"),
        # the U-shaped top of the railing, and its back against the wall
        face(
            [(x0, y0, 0), (x0, y0, far), (x1, y0, far), (x1, y0, 0), (b, y0, 0), (b, y0, c), (a, y0, c), (a, y0, 0)],
            "OuterFloorSurface",
            "level",
        ),
        face(
            [(x1, y1, 0), (x0, y1, 0), (x0, y0, 0), (a, y0, 0), (a, floor, 0), (b, floor, 0), (b, y0, 0), (x1, y0, 0)],
            "WallSurface",
            "front",
        ),
    ]
    return faces


def _texture_places(
    corners: Sequence[tuple[float, float, float]], side: str, box: tuple[float, float, float, float], floor: float
) -> Float64Array:
    """Return the places on the wall that a face shows.

    Fronts show the wall behind them, sides mirror it at their ends, level faces show the edge of the floor.
    """
    x0, _, x1, y1 = box
    x, y, out = np.array(corners, float).T
    deepest = max(float(out.max()), 1e-6)
    if side == "left":
        x = np.minimum(x0 + (deepest - out), x1)
    elif side == "right":
        x = np.maximum(x1 - (deepest - out), x0)
    elif side == "level":
        y = floor + (y1 - floor) * out / deepest
    return np.column_stack([x, y])
