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
    found = []
    for element in elements:
        if element.label in OPENING_ORDER:
            inner = ALIGNMENT.side_share * element.width / 2, ALIGNMENT.side_share * element.height / 2
            x, y = (element.x0 + element.x1) / 2, (element.y0 + element.y1) / 2
            rows = raster[_span(y - inner[1], y + inner[1], down)]
            columns = raster[:, _span(x - inner[0], x + inner[0], across)]
            if rows.size and columns.size:
                by_column, by_row = rows.mean(axis=0), columns.mean(axis=1)
                element = replace(
                    element,
                    x0=_align_side(by_column, element.x0, across, -1),
                    x1=_align_side(by_column, element.x1, across, 1),
                    y0=_align_side(by_row, element.y0, down, -1),
                    y1=_align_side(by_row, element.y1, down, 1),
                )
        found.append(element)
    return found


def _span(first: float, last: float, density: float) -> slice:
    return slice(max(0, int(first * density)), int(np.ceil(last * density)))


def _align_side(profile: Float64Array, side: float, density: float, outward: int) -> float:
    """Return where a side is: at the outermost of the high steps of a profile (n, 3), metres."""
    reach, width = round(ALIGNMENT.max_shift_m * density), max(1, round(ALIGNMENT.step_m * density))
    places = round(side * density) + outward * np.arange(reach, -reach - 1, -1)
    places = places[(places >= width) & (places <= len(profile) - width)]
    if not len(places):
        return side
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(profile, axis=0)])
    step = np.abs(total[places + width] + total[places - width] - 2 * total[places]).max(axis=1) / width
    if step.max() < ALIGNMENT.min_step:
        return side
    around = np.pad(step, 1)
    is_edge = (step >= np.maximum(around[:-2], around[2:])) & (step >= ALIGNMENT.high_share * step.max())
    return float(places[np.argmax(is_edge)] / density)
