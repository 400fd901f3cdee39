"""Encoding a facade image by the variations of its elements (AlSisan & Mitra 2012)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.errors import ImageError, LayoutError
from facade_core.labels import ELEMENT_CLASSES
from facade_core.layout.grids import boxes, check, grids, size_groups
from facade_core.types import Element
from facade_core.variation.appearance import principal_components, relabelling_cost
from facade_core.variation.codec import code_basis, decode_basis, encode_file, quantise_light
from facade_core.variation.contents import Group
from facade_core.variation.element_types import cluster, descriptors, filled
from facade_core.variation.hierarchy import Hierarchy
from facade_core.variation.patches import align, bare_wall, cut, light, mask_of, patch_size, wall_sums
from facade_core.variation.structure import relax

# WebP's limit on a side, and the smallest side of an element in pixels; smaller ones stay part of the wall.
_LARGEST = 16383
_SMALLEST = 3


def encode(image: np.ndarray, elements: Sequence[Element], *, seed: int = 0) -> Hierarchy:
    """The variation-factored hierarchy of a rectified facade.

    image (H, W, 3) uint8; elements in its pixels, clipped to it; those under 3 px stay part of the wall, exact
    duplicates count once. Elements are grouped by class and comparable size, their patches aligned, projected on up to 7
    principal components and clustered into types by mean shift; the types on the repetition grids make the structure
    matrices S0, which ICM on Eq. 1 makes ever more regular, up to one type per grid. A level is a set of matrices that
    differs from the one before by more than names. No element: one level, the wall.

    Nothing is random, so `seed` changes nothing. Raises ImageError for another kind of array, LayoutError for elements
    without area, of an unknown label or outside the image.
    """
    from threadpoolctl import threadpool_limits

    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3 or 0 in image.shape:
        raise ImageError(f"facade image: need a (H, W, 3) uint8 array, not {image.shape} {image.dtype}")
    if max(image.shape) > _LARGEST:
        raise ImageError(
            f"facade image: {image.shape[1]} x {image.shape[0]} px, at most {_LARGEST} a side; downsample it"
        )
    kept = _on_image(elements, image.shape[:2])
    # Sums in BLAS depend on the number of threads in their last bits; one thread keeps files identical.
    with threadpool_limits(1, user_api="blas"):
        return _encode(image, kept)


def _on_image(elements: Sequence[Element], shape: tuple[int, int]) -> list[Element]:
    check(elements)
    height, width = shape
    kept: dict[Element, None] = {}
    for i, e in enumerate(elements):
        if e.x1 <= 0 or e.y1 <= 0 or e.x0 >= width or e.y0 >= height:
            raise LayoutError(f"element {i} ({e.label}): outside the {width} x {height} px image; drop or move it")
        x0, x1 = np.clip(np.round([e.x0, e.x1]), 0, width).tolist()
        y0, y1 = np.clip(np.round([e.y0, e.y1]), 0, height).tolist()
        if min(x1 - x0, y1 - y0) >= _SMALLEST:
            kept[Element(e.label, x0, y0, x1, y1)] = None
    return list(kept)


def _encode(image: np.ndarray, elements: list[Element]) -> Hierarchy:
    all_boxes = boxes(elements).astype(np.int32)
    mask = mask_of(all_boxes, image.shape[:2])
    sums = wall_sums(image, mask)
    depth = np.array([_depth(e.label) for e in elements], int)
    groups, bases, costs, representatives = [], [], [], []
    number = np.zeros(len(elements), np.int32)
    elements_before = types_before = 0
    for members in size_groups(elements):
        size = patch_size(all_boxes[members])
        box = align(image, all_boxes[members], size)
        shade = quantise_light(light(sums, all_boxes[members]))
        patches = cut(image, box, size) / shade[:, None, None, None].astype(np.float32)
        in_front = mask_of(all_boxes[depth > depth[members[0]]], mask.shape)
        seen = cut(in_front.astype(np.float32), box, size) < 0.5
        patches = filled(patches, seen)
        bases.append(code_basis(principal_components(patches)))
        basis = decode_basis(*bases[-1])
        coordinates = basis.project(patches)
        types, chosen = cluster(descriptors(patches, seen))
        costs.append((types_before, relabelling_cost(basis.patches(coordinates[chosen]))))
        representatives.append(chosen + elements_before)
        groups.append(Group(elements[members[0]].label, basis, box, shade, coordinates, types + types_before))
        number[members] = elements_before + np.arange(len(members))
        elements_before += len(members)
        types_before += len(chosen)
    cells = [np.where(g.cells >= 0, number[g.cells], -1).astype(np.int32) for g in grids(elements)]
    types = np.concatenate([g.types for g in groups]) if groups else np.zeros(0, np.int32)
    for group in groups:
        mask |= mask_of(group.boxes, mask.shape)
    wall = bare_wall(image, mask)
    chosen = np.concatenate(representatives) if groups else np.zeros(0, np.int32)
    coded = encode_file(wall, groups, bases, cells, chosen, _levels(cells, types, costs))
    return Hierarchy.from_bytes(coded)


def _depth(label: str) -> int:
    """What is drawn over what: balconies stand before windows."""
    return ELEMENT_CLASSES.index(label) if label in ELEMENT_CLASSES else -1


def _levels(
    cells: list[np.ndarray], types: np.ndarray, costs: list[tuple[int, np.ndarray]]
) -> list[tuple[np.ndarray, ...]]:
    """The structure matrices per level: all grids relaxed with the same weights, states that only rename left out."""
    start = [np.where(c >= 0, types[c], -1).astype(np.int32) if len(types) else c for c in cells]
    steps: list[list[np.ndarray]] = []
    for matrix in start:
        # A grid lies within one group, whose types are consecutive.
        first, cost = next((f, c) for f, c in costs if f <= matrix.max() < f + len(c))
        relaxed = relax(np.where(matrix >= 0, matrix - first, -1), cost)
        steps.append([matrix] + [np.where(matrix >= 0, r.labels + first, -1).astype(np.int32) for r in relaxed])
    levels: list[tuple[np.ndarray, ...]] = [tuple(start)]
    for k in range(1, max((len(s) for s in steps), default=1)):
        state = tuple(s[min(k, len(s) - 1)] for s in steps)
        if any(not np.array_equal(_canonical(a), _canonical(b)) for a, b in zip(state, levels[-1], strict=True)):
            levels.append(state)
    return levels


def _canonical(matrix: np.ndarray) -> np.ndarray:
    """The matrix with its labels renumbered in the order in which they appear."""
    _, first, index = np.unique(matrix, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[index].reshape(matrix.shape)
