"""Variations of a facade's elements before encoding: groups, types and levels of structure matrices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from facade_core.core.arrays import Float64Array, Int32Array, Int64Array, UInt8Array
from facade_core.core.errors import LayoutError
from facade_core.core.types import Element
from facade_core.facade.layout.grids import check_boxes, fit_grids
from facade_core.facade.variation.appearance import project_on_principal_components, relabelling_cost
from facade_core.facade.variation.contents import ElementGroup
from facade_core.facade.variation.element_types import cluster_types, compute_descriptors
from facade_core.facade.variation.group_patches import cut_group_patches
from facade_core.facade.variation.structure import regularise_structure_matrix
from facade_core.facade.variation.window_types import cluster_window_types

# Smallest side of an element; smaller ones remain part of the wall.
_MIN_SIDE_PX = 3


@dataclass(frozen=True, eq=False)
class Variations:
    """Element groups, their types on grids, and costs of relabelling.

    Attributes
    ----------
    groups, cells, representatives : as in `HierarchyContents`.
    costs : per group, number of its first type and (T, T) relabelling costs.
    """

    groups: tuple[ElementGroup, ...]
    cells: tuple[Int32Array, ...]
    representatives: Int32Array
    costs: tuple[tuple[int, Float64Array], ...]

    @cached_property
    def types(self) -> Int32Array:
        """Return the (N,) int32 types of all elements in the photo."""
        return np.concatenate([g.types for g in self.groups]) if self.groups else np.zeros(0, np.int32)

    @cached_property
    def levels(self) -> tuple[tuple[Int32Array, ...], ...]:
        """Return the structure matrices of each level.

        All grids are relaxed with the same weights; states that differ by names only are omitted.
        """
        start = [np.where(c >= 0, self.types[c], -1).astype(np.int32) for c in self.cells]
        steps: list[list[Int32Array]] = []
        for matrix in start:
            # A grid is part of one group, whose types are consecutive.
            first, cost = next((f, c) for f, c in self.costs if f <= matrix.max() < f + len(c))
            relaxed = regularise_structure_matrix(np.where(matrix >= 0, matrix - first, -1), cost)
            steps.append([matrix] + [np.where(matrix >= 0, r.labels + first, -1).astype(np.int32) for r in relaxed])
        levels: list[tuple[Int32Array, ...]] = [tuple(start)]
        for k in range(1, max((len(s) for s in steps), default=1)):
            state = tuple(s[min(k, len(s) - 1)] for s in steps)
            if any(
                not np.array_equal(_canonical_labels(a), _canonical_labels(b))
                for a, b in zip(state, levels[-1], strict=True)
            ):
                levels.append(state)
        return tuple(levels)

    def types_at(self, level: int) -> Int32Array:
        """Return the (N,) int32 types of all elements at a level."""
        found = self.types.copy()
        for matrix, cells in zip(self.levels[level], self.cells, strict=True):
            found[cells[cells >= 0]] = matrix[cells >= 0]
        return found

    def permute_elements(self, shown: Int64Array) -> Variations:
        """Return the variations after a permutation of elements within groups.

        Parameters
        ----------
        shown : (N,) int element shown at each place.
        """
        types, back, groups = self.types[shown], np.argsort(shown), []
        first = 0
        for group in self.groups:
            groups.append(replace(group, types=types[first : first + len(group.boxes)]))
            first += len(group.boxes)
        return Variations(tuple(groups), self.cells, back[self.representatives].astype(np.int32), self.costs)


def find_variations(image: UInt8Array, elements: Sequence[Element]) -> Variations:
    """Find the types of an image's elements and the costs of relabelling them.

    Elements are grouped by label and comparable size, and their patches aligned. Windows are clustered by a learnt
    metric, other elements by mean shift. Costs are measured between patches projected on up to 7 principal components.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    elements : in pixels, clipped to the image; those under 3 px are omitted, exact duplicates count once.

    Raises
    ------
    LayoutError
        For elements without area, of an unknown label or outside the image.
    """
    return _find_variations(image, clip_to_image(elements, image.shape[:2]))


def clip_to_image(elements: Sequence[Element], shape: tuple[int, int]) -> list[Element]:
    """Round elements to pixels of an image (height, width); drop those under 3 px and duplicates."""
    check_boxes(elements)
    height, width = shape
    kept: dict[Element, None] = {}
    for i, e in enumerate(elements):
        if e.x1 <= 0 or e.y1 <= 0 or e.x0 >= width or e.y0 >= height:
            raise LayoutError(f"element {i} ({e.label}): outside the {width} x {height} px image; drop or move it")
        x0, x1 = np.clip(np.round([e.x0, e.x1]), 0, width).tolist()
        y0, y1 = np.clip(np.round([e.y0, e.y1]), 0, height).tolist()
        if min(x1 - x0, y1 - y0) >= _MIN_SIDE_PX:
            kept[Element(e.label, x0, y0, x1, y1)] = None
    return list(kept)


def _find_variations(image: UInt8Array, elements: list[Element]) -> Variations:
    groups, costs, representatives = [], [], []
    number = np.zeros(len(elements), np.int32)
    elements_before = types_before = 0
    for group in cut_group_patches(image, elements):
        label = elements[group.members[0]].label
        types, chosen = (
            cluster_window_types(group)
            if label == "window"
            else cluster_types(compute_descriptors(group.patches, group.seen))
        )
        costs.append((types_before, relabelling_cost(project_on_principal_components(group.patches)[chosen])))
        representatives.append(chosen + elements_before)
        groups.append(ElementGroup(label, group.boxes, group.light, types + types_before))
        number[group.members] = elements_before + np.arange(len(group.members))
        elements_before += len(group.members)
        types_before += len(chosen)
    cells = tuple(np.where(g.cells >= 0, number[g.cells], -1).astype(np.int32) for g in fit_grids(elements))
    chosen = np.concatenate(representatives) if groups else np.zeros(0, np.int32)
    return Variations(tuple(groups), cells, chosen, tuple(costs))


def _canonical_labels(matrix: Int32Array) -> Int64Array:
    """Renumber the labels of a matrix in the order of their first occurrence."""
    _, first, index = np.unique(matrix, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[index].reshape(matrix.shape)
