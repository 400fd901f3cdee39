"""Validation of layouts, domains and observed regions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.core.arrays import Float64Array
from facade_core.core.errors import LayoutError
from facade_core.core.types import Element
from facade_core.facade.layout.facade_frame import Rectangle
from facade_core.facade.layout.grids import box_array, check_boxes
from facade_core.facade.layout.rectangles import overlap_mask


def check_domain(domain: Rectangle) -> None:
    """Raise LayoutError for a domain that is no rectangle with an area."""
    if len(domain) != 4 or not np.isfinite(domain).all() or not (domain[0] < domain[2] and domain[1] < domain[3]):
        raise LayoutError(f"domain {tuple(domain)}: give finite x0 < x1 and y0 < y1")


def check_elements(elements: Sequence[Element], domain: Rectangle) -> None:
    """Raise LayoutError for an element of an unknown label, without area, or centred outside the domain."""
    check_boxes(elements)
    box = box_array(elements)
    centre = (box[:, :2] + box[:, 2:]) / 2
    outside = ~((centre >= domain[:2]) & (centre <= domain[2:])).all(axis=1)
    for i in np.flatnonzero(outside).tolist():
        raise LayoutError(
            f"element {i} ({elements[i].label}): centred outside the domain {tuple(domain)}; drop or move it"
        )


def check_region(observed: Sequence[Element], domain: Rectangle, observed_region: Sequence[Rectangle]) -> Float64Array:
    """Check the observed region and return it as (M, 4) boxes.

    Raises
    ------
    LayoutError
        For a box outside the domain, an element outside every box, or elements without any box.
    """
    region = np.array([tuple(b) for b in observed_region], float).reshape(-1, 4)
    x0, y0, x1, y1 = domain
    for i, (a0, b0, a1, b1) in enumerate(region.tolist()):
        if not (a0 < a1 and b0 < b1 and a0 < x1 and a1 > x0 and b0 < y1 and b1 > y0):
            raise LayoutError(f"observed region {i}: needs an area inside the domain, not {(a0, b0, a1, b1)}")
    if observed and not len(region):
        raise LayoutError("observed region: empty though elements were seen; give the boxes that are visible")
    for i in np.flatnonzero(~overlap_mask(box_array(observed), region).any(axis=1)).tolist():
        raise LayoutError(
            f"element {i} ({observed[i].label}): outside the observed region; extend the region or drop it"
        )
    return region
