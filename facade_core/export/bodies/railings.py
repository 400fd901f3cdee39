"""Railings that are seen through: bars, a handrail and a floor, textured by the picture of the wall."""

from __future__ import annotations

import numpy as np
from shapely import Polygon

from facade_core.core.arrays import Float64Array, UInt8Array
from facade_core.export.bodies.balconies import balcony_floor
from facade_core.export.bodies.settings import RAILINGS


def is_seen_through(raster: UInt8Array, texels_per_metre: Float64Array, box: Polygon) -> bool:
    """Return whether a balcony's railing is seen through: its columns differ in light, those of a parapet are alike.

    Parameters
    ----------
    raster : (h, w, 3) picture of the wall.
    texels_per_metre : (2,) texels per metre across and down.
    box : rectangle of the balcony in the chart's frame, metres.
    """
    x0, y0, x1, y1 = box.bounds
    corners = np.array([x0, y0 + RAILINGS.handrail_m, x1, balcony_floor(y0, y1)]) * np.tile(texels_per_metre, 2)
    left, top, right, foot = np.maximum(np.rint(corners), 0).astype(int).tolist()
    behind = raster[top:foot, left:right]
    return behind.size > 0 and float(behind.mean(axis=(0, 2)).std()) >= RAILINGS.min_contrast


def railing_quads(box: Polygon, far: float) -> tuple[Float64Array, Float64Array]:
    """Build the floor, the handrail and the bars of a balcony over a rectangle of its wall.

    Parameters
    ----------
    box : rectangle in the chart's frame.
    far : depth of the balcony, metres.

    Returns
    -------
    Corners (q, 4, 3) in metres right, down and outward, counter-clockwise as seen from outside, and the places (q, 4, 2)
    that they show: fronts the wall behind them, sides the wall mirrored at their ends, level faces the edge of the floor.
    """
    x0, y0, x1, y1 = box.bounds
    floor, below = balcony_floor(y0, y1), y0 + RAILINGS.handrail_m
    rail = min(RAILINGS.handrail_m, far / 2)
    fronts = [(x0, y1, x1, floor), (x0, below, x1, y0), *((a, floor, b, below) for a, b in _bar_spans(x0, x1))]
    sides = [(0.0, y1, far, floor), (0.0, below, far, y0), *((a, floor, b, below) for a, b in _bar_spans(0.0, far))]
    levels = [(0.0, far, y1, True), (0.0, far, floor, False), (far - rail, far, y0, False)]
    quads, places = [], []
    for left, low, right, high in fronts:
        quads.append([(left, low, far), (right, low, far), (right, high, far), (left, high, far)])
        places.append([(left, low), (right, low), (right, high), (left, high)])
    for near, low, out, high in sides:
        a, b = far - near, far - out  # a side shows the wall from its end on
        quads.append([(x0, low, near), (x0, low, out), (x0, high, out), (x0, high, near)])
        left, right = min(x0 + a, x1), min(x0 + b, x1)
        places.append([(left, low), (right, low), (right, high), (left, high)])
        quads.append([(x1, low, out), (x1, low, near), (x1, high, near), (x1, high, out)])
        left, right = max(x1 - b, x0), max(x1 - a, x0)
        places.append([(left, low), (right, low), (right, high), (left, high)])
    for near, out, row, is_underside in levels:
        ring = [(x0, row, near), (x1, row, near), (x1, row, out), (x0, row, out)]
        shown = (
            [(x0, floor), (x1, floor), (x1, y1), (x0, y1)]
            if row != y0
            else [(x0, y0), (x1, y0), (x1, below), (x0, below)]
        )
        quads.append(ring if is_underside else ring[::-1])
        places.append(shown if is_underside else shown[::-1])
    return np.array(quads), np.array(places)


def _bar_spans(first: float, last: float) -> list[tuple[float, float]]:
    """Return the ends of bars of a railing between two places, metres."""
    count = max(1, round((last - first) / RAILINGS.bar_spacing_m))
    middle = first + (np.arange(count) + 0.5) * (last - first) / count
    return [(x - RAILINGS.bar_width_m / 2, x + RAILINGS.bar_width_m / 2) for x in middle.tolist()]
