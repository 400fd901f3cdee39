"""Selection of one layout from rated proposals, and its alignment to common lines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, Int64Array, IntArray
from facade_core.core.labels import ELEMENT_CLASSES
from facade_core.core.types import Element
from facade_core.facade.layout.facade_frame import Rectangle
from facade_core.facade.layout.grids import box_array
from facade_core.facade.layout.proposals import Proposals
from facade_core.facade.layout.rectangles import WINDOW, labels_may_overlap, overlap_mask

# Largest distance between edges of one line, as a share of the side.
_LINE_TOLERANCE = 0.2


class PlacementSpace(NamedTuple):
    """Place of new elements of a facade.

    Attributes
    ----------
    domain : (x0, y0, x1, y1) of the facade.
    region : (M, 4) visible boxes, where no element is added.
    obstacles : (K, 4) boxes that no element may overlap.
    """

    domain: Rectangle
    region: Float64Array
    obstacles: Float64Array


def select_proposals(
    box: Float64Array,
    label: IntArray,
    preference: Float64Array,
    selectable: BoolArray,
    obstacles: Float64Array,
    min_gap: float = 0.0,
) -> Int64Array:
    """Select proposals greedily by preference, without conflicts.

    Parameters
    ----------
    box : (N, 4) x0, y0, x1, y1.
    label : (N,) index into ELEMENT_CLASSES.
    preference : (N,) higher is selected first.
    selectable : (N,) bool.
    obstacles : (M, 4) boxes that a proposal may not overlap.
    min_gap : smallest horizontal distance between windows.

    Returns
    -------
    Indices in the order of selection.
    """
    if len(obstacles):
        selectable = selectable & ~overlap_mask(box, obstacles).any(axis=1)
    index = np.flatnonzero(selectable)
    index = index[np.argsort(-preference[index], kind="stable")]
    excludes = overlap_mask(box[index], box[index]) & ~labels_may_overlap(label[index], label[index])
    if min_gap > 0:
        window = label[index] == WINDOW
        excludes |= (
            overlap_mask(box[index] + np.array([-min_gap, 0, min_gap, 0]), box[index]) & window[:, None] & window
        )
    kept: list[int] = []
    open_ = np.ones(len(index), bool)
    for k in range(len(index)):
        if open_[k]:
            kept.append(k)
            open_ &= ~excludes[k]
    return index[kept]


def align_proposal_edges(
    proposals: Proposals,
    selected: Int64Array,
    probability: Float64Array,
    observed_elements: Sequence[Element],
    space: PlacementSpace,
) -> tuple[Element, ...]:
    """Return the selected proposals with nearly equal edges made equal.

    Edges align to observed elements first, then to the likeliest proposals. A proposal that would collide keeps its
    edges.

    Parameters
    ----------
    selected : indices into `proposals`.
    probability : (N,) probability of each proposal; becomes the confidence of an element.
    observed_elements : observed elements of ELEMENT_CLASSES.
    space : place of new elements.

    Returns
    -------
    Elements from top to bottom, left to right.
    """
    box, label = proposals.box[selected].copy(), proposals.label[selected].astype(int)
    observed = box_array(observed_elements)
    observed_label = np.array([ELEMENT_CLASSES.index(e.label) for e in observed_elements], int)
    labels = np.concatenate([label, observed_label])
    order = np.argsort(-probability[selected], kind="stable")
    for axis in (0, 1):
        for k in np.unique(label).tolist():
            known = [tuple(edges) for edges in observed[observed_label == k][:, [axis, axis + 2]].tolist()]
            for i in (i for i in order.tolist() if label[i] == k):
                low, high = box[i, axis], box[i, axis + 2]
                side = high - low
                line = _nearest_line(known, low, high, _LINE_TOLERANCE * side)
                if line is None:
                    known.append((low, high))
                    continue
                moved = box[i].copy()
                moved[axis], moved[axis + 2] = line
                if _is_placeable(moved, i, np.concatenate([box, observed]), labels, space):
                    box[i] = moved
    elements = [
        Element(ELEMENT_CLASSES[n], x0, y0, x1, y1, round(chance, 3))
        for n, (x0, y0, x1, y1), chance in zip(
            label.tolist(), box.tolist(), probability[selected].tolist(), strict=True
        )
    ]
    return tuple(sorted(elements, key=lambda e: (e.y0, e.x0, e.label, e.y1, e.x1)))


def _nearest_line(
    known: Sequence[tuple[float, ...]], low: float, high: float, reach: float
) -> tuple[float, ...] | None:
    best, best_away = None, reach
    for line in known:
        away = max(abs(line[0] - low), abs(line[1] - high))
        if away < best_away:
            best, best_away = line, away
    return best


def _is_placeable(
    moved: Float64Array, own: int, boxes: Float64Array, labels: Int64Array, space: PlacementSpace
) -> bool:
    """Return whether element `own` of all elements (n, 4) may take the place `moved`."""
    one, domain = moved[None], space.domain
    if moved[0] < domain[0] or moved[1] < domain[1] or moved[2] > domain[2] or moved[3] > domain[3]:
        return False
    if overlap_mask(one, space.region).any() or overlap_mask(one, space.obstacles).any():
        return False
    met = (overlap_mask(one, boxes) & ~labels_may_overlap(labels[[own]], labels))[0]
    met[own] = False
    return not met.any()
