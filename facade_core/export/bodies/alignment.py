"""Elements as their picture shows them: openings end at its edges, light bands are ledges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from facade_core.core.arrays import Float64Array, UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.core.types import Element
from facade_core.export.bodies.ledges import detect_ledges
from facade_core.export.bodies.openings import OPENING_ORDER
from facade_core.export.bodies.settings import ALIGNMENT


def align_with_picture(
    raster: UInt8Array, texels_per_metre: Float64Array, elements: Sequence[Element], labels: UInt8Array | None = None
) -> list[Element]:
    """Align the openings of a wall with its picture, and add its ledges.

    Parameters
    ----------
    raster : (h, w, 3) picture of the wall.
    texels_per_metre : (2,) texels per metre across and down.
    elements : elements in metres, y down.
    labels : (h, w) facade classes; None if all beside the elements is wall.
    """
    labels = np.full(raster.shape[:2], FacadeClass.WALL, np.uint8) if labels is None else labels
    aligned = align_openings(raster, texels_per_metre, elements)
    return [*aligned, *detect_ledges(raster, labels, aligned, float(texels_per_metre[1]))]


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
    found = []
    for element in elements:
        if element.label in OPENING_ORDER:
            rows = _middle_span(element.y0, element.y1, down)
            columns = _middle_span(element.x0, element.x1, across)
            element = replace(
                element,
                x0=_align_side(raster[rows], element.x0, across, -1),
                x1=_align_side(raster[rows], element.x1, across, 1),
                y0=_align_side(turned[columns], element.y0, down, -1),
                y1=_align_side(turned[columns], element.y1, down, 1),
            )
        found.append(element)
    return found


def _middle_span(first: float, last: float, density: float) -> slice:
    """Return the texels of the middle of a side, whose edge counts."""
    middle, half = (first + last) / 2, ALIGNMENT.side_share * (last - first) / 2
    return slice(max(0, int((middle - half) * density)), int(np.ceil((middle + half) * density)))


def _align_side(strip: UInt8Array, side: float, density: float, outward: int) -> float:
    """Return where a side is, metres: at the outermost of the high steps of a strip (k, n, 3) across it."""
    reach, width = round(ALIGNMENT.max_shift_m * density), max(1, round(ALIGNMENT.step_m * density))
    middle = round(side * density)
    places = np.arange(max(middle - reach, width), min(middle + reach, strip.shape[1] - width) + 1)[::-outward]
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
