"""Units of a facade: elements that belong together, such as a window with its balcony, and their surrounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import connected_components

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, UInt8Array
from facade_core.core.labels import ELEMENT_CLASSES
from facade_core.core.types import Element
from facade_core.export.factored.settings import FACADE_UNITS

Rectangle = tuple[float, float, float, float]

# Labels of elements, the most significant of a unit first.
UNIT_KINDS = ("shop", "door", "balcony", "window")


@dataclass(frozen=True)
class FacadeUnit:
    """Elements of a facade that belong together, such as a window with its balcony.

    Attributes
    ----------
    kind : most significant label.
    box : x0, y0, x1, y1 in metres, y down.
    panes : recessed rectangles in it.
    """

    kind: str
    box: Rectangle
    panes: tuple[Rectangle, ...]

    @property
    def size(self) -> tuple[float, float]:
        """Return width and height, metres."""
        return self.box[2] - self.box[0], self.box[3] - self.box[1]


def group_elements_into_units(elements: Sequence[Element], density: float) -> list[FacadeUnit]:
    """Group elements to units, sorted by rows from the top, then from the left.

    Parameters
    ----------
    elements : elements in pixels.
    density : pixels per metre.
    """
    kept = [e for e in elements if e.label in ELEMENT_CLASSES and min(e.width, e.height) / density > 0.2]
    boxes = np.array([(e.x0, e.y0, e.x1, e.y1) for e in kept]).reshape(-1, 4) / density
    balcony = np.array([e.label == "balcony" for e in kept], bool)
    low, high = boxes[:, :2], boxes[:, 2:]
    near = (
        (low[:, None] <= high[None] + FACADE_UNITS.max_gap_m) & (high[:, None] >= low[None] - FACADE_UNITS.max_gap_m)
    ).all(axis=-1)
    across = np.minimum(high[:, None, 0], high[None, :, 0]) - np.maximum(low[:, None, 0], low[None, :, 0]) > 0
    union = np.maximum(high[:, None, 0], high[None, :, 0]) - np.minimum(low[:, None, 0], low[None, :, 0])
    joined = near & across & (union <= FACADE_UNITS.max_unit_width_m) & (balcony[:, None] ^ balcony[None])
    count, of = connected_components(joined, directed=False) if len(kept) else (0, np.zeros(0))
    found = []
    for number in range(count):
        mine = np.flatnonzero(of == number)
        kind = min((kept[i].label for i in mine), key=UNIT_KINDS.index)
        box = (*boxes[mine, :2].min(axis=0).tolist(), *boxes[mine, 2:].max(axis=0).tolist())
        found.append(FacadeUnit(kind, box, tuple(_uncovered_panes(boxes[mine], balcony[mine]))))
    return sorted(found, key=lambda unit: (unit.box[1], unit.box[0]))


def _uncovered_panes(boxes: Float64Array, balcony: BoolArray) -> list[Rectangle]:
    """Return the parts of windows, doors and shops that no balcony covers."""
    found = []
    for x0, y0, x1, y1 in boxes[~balcony].tolist():
        for _, top, _, foot in boxes[balcony].tolist():
            if top < y1 and foot > y0:
                y0, y1 = (y0, top) if top - y0 > y1 - foot else (foot, y1)
        if y1 - y0 > 0.2:
            found.append((x0, y0, x1, y1))
    return found


def surround_reach(
    image: UInt8Array, others: BoolArray, wall: Float32Array, box: Rectangle, density: float
) -> tuple[float, float, float, float]:
    """Measure how far the surround of a unit reaches beyond its box.

    Parameters
    ----------
    image : (h, w, 3) uint8.
    others : (h, w) bool, other units.
    wall : (h, w, 3) float32 colour of the wall around each pixel, grey levels.
    box : x0, y0, x1, y1 in metres.
    density : pixels per metre.

    Returns
    -------
    Reach to the left, up, right and down, metres.
    """
    height, width = others.shape
    x0, y0, x1, y1 = (round(side * density) for side in box)
    reach = []
    for axis, outward, start in ((1, -1, x0), (0, -1, y0), (1, 1, x1), (0, 1, y1)):
        limit = round(FACADE_UNITS.max_reach_m * density)
        last = 0
        for step in range(limit):
            at = start + outward * step - (outward < 0)
            if not 0 <= at < (width if axis else height):
                break
            line = (slice(max(0, y0), y1), at) if axis else (at, slice(max(0, x0), x1))
            if others[line].mean() > 0.1:
                break
            off = np.abs(image[line].astype(np.float32) - wall[line]).max(axis=1) > FACADE_UNITS.min_grey_difference
            if off.mean() > FACADE_UNITS.min_different_share:
                last = step + 1
        reach.append(max(FACADE_UNITS.min_reach_m, last / density + 0.03))
    return tuple(reach)  # type: ignore[return-value]
