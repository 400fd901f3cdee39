"""Elements as their picture shows them: openings end at its edges, light bands are ledges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from facade_core.core.arrays import Float64Array, UInt8Array
from facade_core.core.types import Element
from facade_core.export.bodies.balconies import extend_windows_behind_railings
from facade_core.export.bodies.ledges import detect_ledges
from facade_core.export.bodies.openings import OPENING_ORDER
from facade_core.export.bodies.settings import ALIGNMENT


def align_with_picture(
    raster: UInt8Array, texels_per_metre: Float64Array, elements: Sequence[Element]
) -> list[Element]:
    """Align the openings of a wall with its picture, extend windows behind railings, and add ledges.

    Parameters
    ----------
    raster : (h, w, 3) picture of the wall.
    texels_per_metre : (2,) texels per metre across and down.
    elements : elements in metres, y down.
    """
    aligned = extend_windows_behind_railings(align_openings(raster, texels_per_metre, elements))
    return [*aligned, *detect_ledges(raster, aligned, float(texels_per_metre[1]))]


def align_openings(raster: UInt8Array, texels_per_metre: Float64Array, elements: Sequence[Element]) -> list[Element]:
    """Move the sides of openings to the outermost strong edges of the picture near them.

    Parameters
    ----------
    raster : (h, w, 3) picture of the wall.
    texels_per_metre : (2,) texels per metre across and down.
    elements : elements in metres, y down.
    """
    across, down = texels_per_metre.tolist()
    turned = raster.transpose(1, 0, 2)
    boxes = np.array([(e.x0, e.y0, e.x1, e.y1) for e in elements if e.label in OPENING_ORDER]).reshape(-1, 4)
    found = []
    for element in elements:
        if element.label in OPENING_ORDER:
            rows = _middle_span(element.y0, element.y1, down)
            columns = _middle_span(element.x0, element.x1, across)
            x0, x1 = _align_sides(raster[rows], (element.x0, element.x1), _free_space(element, boxes, 0), across)
            y0, y1 = _align_sides(turned[columns], (element.y0, element.y1), _free_space(element, boxes, 1), down)
            element = replace(element, x0=x0, x1=x1, y0=y0, y1=y1)
        found.append(element)
    return found


def _middle_span(first: float, last: float, density: float) -> slice:
    """Return the texels of the middle of a side, whose edge counts."""
    middle, half = (first + last) / 2, ALIGNMENT.side_share * (last - first) / 2
    return slice(max(0, int((middle - half) * density)), int(np.ceil((middle + half) * density)))


def _free_space(element: Element, boxes: Float64Array, axis: int) -> tuple[float, float]:
    """Return how far the sides of an opening may move outward: half the gap to the next of some (n, 4), metres."""
    own = np.array([element.x0, element.y0, element.x1, element.y1])
    other = 1 - axis
    is_level = (boxes[:, other] < own[other + 2]) & (boxes[:, other + 2] > own[other])
    before, after = own[axis] - boxes[is_level, axis + 2], boxes[is_level, axis] - own[axis + 2]
    most = 2 * ALIGNMENT.max_shift_m
    gaps = (np.min(gap[gap >= 0], initial=most) / 2 for gap in (before, after))
    return float(next(gaps)), float(next(gaps))


def _align_sides(
    strip: UInt8Array, sides: tuple[float, float], free: tuple[float, float], density: float
) -> tuple[float, float]:
    """Return both sides across a strip (k, n, 3), metres; inward they stay apart."""
    inward = min(ALIGNMENT.max_shift_m, ALIGNMENT.max_inward_share * (sides[1] - sides[0]))
    first = _align_side(strip, sides[0], (sides[0] - free[0], sides[0] + inward), density, -1)
    return first, _align_side(strip, sides[1], (sides[1] - inward, sides[1] + free[1]), density, 1)


def _align_side(strip: UInt8Array, side: float, span: tuple[float, float], density: float, outward: int) -> float:
    """Return where a side is, metres: at the outermost of the high steps of a strip (k, n, 3) in a span."""
    width = max(1, round(ALIGNMENT.step_m * density))
    first, last = (np.array(span) * density).tolist()
    places = np.arange(max(np.ceil(first), width), min(np.floor(last), strip.shape[1] - width) + 1)[::-outward].astype(
        int
    )
    if not len(places) or not len(strip):
        return side
    start = int(places.min()) - width
    profile = strip[:, start : int(places.max()) + width].mean(axis=0)
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(profile, axis=0)])
    here = places - start
    step = np.abs(total[here + width] + total[here - width] - 2 * total[here]).max(axis=1) / width
    if step.max() < ALIGNMENT.min_step:
        return side
    is_edge = step >= ALIGNMENT.high_share * step.max()
    is_edge[1:] &= step[1:] >= step[:-1]
    is_edge[:-1] &= step[:-1] >= step[1:]
    return float(places[np.argmax(is_edge)] / density)
