"""Elements of a wall in depth: one description for every model that builds them as geometry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import shapely
from shapely import Polygon

from facade_core.core.types import Element
from facade_core.export.bodies.balconies import place_balconies
from facade_core.export.bodies.openings import place_openings
from facade_core.export.bodies.settings import BALCONY_SHAPES, WALL_OPENINGS, ElementDepth, element_depth


@dataclass(frozen=True)
class ElementRelief:
    """Element of a wall in depth.

    Attributes
    ----------
    label : class.
    outline : outline in the chart's frame, metres, y down.
    depth : its own depth, or that of its class, and the source of the value.
    is_cut : True if the wall's border or another element cuts the element.
    """

    label: str
    outline: Polygon
    depth: ElementDepth
    is_cut: bool


def place_elements(wall: Polygon, elements: Sequence[Element]) -> list[ElementRelief]:
    """Place the balconies, doors, windows and shops of a wall, in an order that does not depend on theirs.

    Openings are kept apart, and within the wall's border.

    Parameters
    ----------
    wall : outline of the wall in its chart's frame.
    elements : elements in metres, y down from the chart's top left.
    """
    if not wall.is_valid:
        return []
    placed = [*place_balconies(wall, elements), *place_openings(wall, elements)]
    return [
        ElementRelief(element.label, outline, element_depth(element), _is_cut(element, outline))
        for element, outline in placed
    ]


def _is_cut(element: Element, outline: Polygon) -> bool:
    """Return True if an outline is more than a gap smaller than its element, or no rectangle."""
    gap = max(WALL_OPENINGS.wall_edge_m, WALL_OPENINGS.opening_gap_m, BALCONY_SHAPES.railing_thickness_m) + 1e-6
    inner = shapely.box(element.x0 + gap, element.y0 + gap, element.x1 - gap, element.y1 - gap)
    is_rectangle = outline.area >= (1 - 1e-6) * shapely.envelope(outline).area
    return not (is_rectangle and outline.covers(inner))
