"""Repetition grids of facade elements: equal label, comparable size, common rows and columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from facade_core.core.arrays import Float64Array, Int32Array, Int64Array
from facade_core.core.errors import LayoutError
from facade_core.core.labels import CLASSES
from facade_core.core.types import Element

# Largest difference of sides of comparable size (natural logarithm).
_SIZE_TOLERANCE = 0.45
# Largest distance between centres of one row or column, as a share of the element size.
ALIGNMENT_TOLERANCE = 0.35


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """Elements of one label on common rows and columns; cells may be empty.

    Attributes
    ----------
    rows, columns : centre positions, ascending, in the elements' unit.
    width, height : median size of the elements.
    cells : (rows, columns) int32 index into the sequence given to `fit_grids`, -1 for an empty cell.

    References
    ----------
    Fan et al. 2014, section 3.2.
    """

    label: str
    rows: tuple[float, ...]
    columns: tuple[float, ...]
    width: float
    height: float
    cells: Int32Array

    @property
    def completeness(self) -> float:
        """Return the share of cells with an element (Eq. 4 of Fan et al. 2014)."""
        return float((self.cells >= 0).mean())


def box_array(elements: Sequence[Element]) -> Float64Array:
    """Return the (N, 4) float array of x0, y0, x1, y1."""
    return np.array([(e.x0, e.y0, e.x1, e.y1) for e in elements], float).reshape(-1, 4)


def check_boxes(elements: Sequence[Element]) -> None:
    """Raise LayoutError for the first element with an unknown label, a non-finite side or no area."""
    for i, e in enumerate(elements):
        if e.label not in CLASSES:
            raise LayoutError(f"element {i}: unknown label {e.label!r}; use one of {', '.join(CLASSES)}")
        if not np.isfinite((e.x0, e.y0, e.x1, e.y1)).all():
            raise LayoutError(f"element {i} ({e.label}): coordinates must be finite, not {e}")
        if e.width <= 0 or e.height <= 0:
            raise LayoutError(f"element {i} ({e.label}): no area, x0 < x1 and y0 < y1 are needed, not {e}")


def fit_grids(elements: Sequence[Element]) -> list[Grid]:
    """Fit repetition grids so that each element is in exactly one cell of one grid.

    Elements are grouped by label and comparable size, groups are cut into rows, and rows that share most of their
    columns form one grid. The rows of interleaved patterns therefore form separate grids, and grids may overlap. The
    result does not depend on the order of the elements.

    Returns
    -------
    Labels in the order of CLASSES; the largest grid of a label first.

    Raises
    ------
    LayoutError
        For an unknown label, a non-finite side or an element without area.
    """
    box = box_array(elements)
    found: dict[str, list[Grid]] = {}
    for group in group_by_size(elements):
        label = elements[group[0]].label
        found.setdefault(label, []).extend(_fit(label, box, group))
    return [
        g
        for of_label in found.values()
        for g in sorted(of_label, key=lambda g: (-(g.cells >= 0).sum(), g.rows, g.columns))
    ]


def group_by_size(elements: Sequence[Element]) -> list[Int64Array]:
    """Group the indices of elements by label and comparable size, labels in the order of CLASSES.

    Every grid of `fit_grids` is part of one group. Raises LayoutError as `fit_grids` does.
    """
    check_boxes(elements)
    box = box_array(elements)
    found: list[Int64Array] = []
    for label in CLASSES:
        members = np.array([i for i, e in enumerate(elements) if e.label == label], int)
        found += _split_by_size(box, members[np.lexsort(box[members].T)])
    return found


def _split_by_size(box: Float64Array, members: Int64Array) -> list[Int64Array]:
    if len(members) < 2:
        return [members] if len(members) else []
    from scipy.cluster.hierarchy import fcluster, linkage

    size = np.log(box[members, 2:] - box[members, :2])
    labels = fcluster(linkage(size, "average", metric="chebyshev"), _SIZE_TOLERANCE, "distance")
    return [members[labels == k] for k in np.unique(labels)]


def _cluster_index(values: Float64Array, gap: float) -> Int64Array:
    """Return the (N,) cluster of each value; clusters ascend and are more than `gap` apart."""
    order = np.argsort(values, kind="stable")
    index = np.empty(len(values), int)
    index[order] = np.concatenate([[0], np.cumsum(np.diff(values[order]) > gap)])
    return index


def _cluster_means(values: Float64Array, index: Int64Array) -> Float64Array:
    return np.bincount(index, values) / np.bincount(index)


def _fit(label: str, box: Float64Array, members: Int64Array) -> list[Grid]:
    found: list[Grid] = []
    while len(members):  # elements that share a cell form separate grids
        some, members = _fit_once(label, box, members)
        found += some
    return found


def _fit_once(label: str, box: Float64Array, members: Int64Array) -> tuple[list[Grid], Int64Array]:
    """Fit grids, and return the members whose cell was already taken."""
    centre = (box[members, :2] + box[members, 2:]) / 2
    width, height = np.median(box[members, 2:] - box[members, :2], axis=0)
    gap_x, gap_y = ALIGNMENT_TOLERANCE * width, ALIGNMENT_TOLERANCE * height
    row = _cluster_index(centre[:, 1], gap_y)
    found: list[Grid] = []
    left_over: list[int] = []
    for part in _row_groups(centre[:, 0], row, width, gap_x):
        inside = np.isin(row, part)
        index = members[inside]
        y = _cluster_index(centre[inside, 1], gap_y)
        x = _cluster_index(centre[inside, 0], gap_x)
        rows, columns = _cluster_means(centre[inside, 1], y), _cluster_means(centre[inside, 0], x)
        cells = np.full((len(rows), len(columns)), -1, np.int32)
        for i, r, c in zip(index, y, x, strict=True):
            if cells[r, c] < 0:
                cells[r, c] = i
            else:
                left_over.append(int(i))
        used = cells[cells >= 0]
        size = np.median(box[used, 2:] - box[used, :2], axis=0)
        found.append(Grid(label, tuple(rows.tolist()), tuple(columns.tolist()), float(size[0]), float(size[1]), cells))
    return found, np.array(left_over, int)


def _row_groups(x: Float64Array, row: Int64Array, width: float, gap: float) -> list[list[int]]:
    """Join rows, fullest first, if half the shorter row's columns agree and the others do not overlap them."""
    counts = np.bincount(row)
    groups: list[tuple[list[int], Float64Array]] = []
    for r in np.argsort(-counts, kind="stable"):
        own = np.sort(x[row == r])
        best, best_share = -1, 0.5
        for k, (_, columns) in enumerate(groups):
            distance = np.abs(own[:, None] - columns).min(axis=1)
            aligned = distance <= gap
            share = aligned.sum() / min(len(own), len(columns))
            if share >= best_share and not (~aligned & (distance < width)).any():
                best, best_share = k, share
        if best < 0:
            groups.append(([int(r)], own))
        else:
            rows, columns = groups[best]
            joined = np.concatenate([columns, own])
            groups[best] = ([*rows, int(r)], _cluster_means(joined, _cluster_index(joined, gap)))
    return [rows for rows, _ in groups]
