"""Placement of elements by the policy: spacings, gaps, snapping and hard constraints; compiled."""

# ruff: noqa: NPY002  (compiled code has its own copy of the legacy generator, seeded at each roll-out)

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, Int64Array
from facade_core.core.numba_cache import njit
from facade_core.facade.layout.rectangles import BALCONY, WINDOW

# Label of an element that takes up space and is no part of the layout.
NULL = 4
# Largest snapping distance, as a share of the element's size.
_SNAP_SHARE = 0.4


class ObservedLayoutArrays(NamedTuple):
    """Observed layout and database priors as the arrays that `roll_out_policy` needs.

    Attributes
    ----------
    box : (N, 4) x0, y0, x1, y1.
    label : (N,) index into ELEMENT_CLASSES.
    grid : (N,) grid index of each element.
    spacing : (N, 2) distances of `next_element_distances`.
    gaps : (N,) bool of `mark_elements_beside_gaps`.
    grids : number of grids.
    domain : (4,) x0, y0, x1, y1 of the facade.
    region : (M, 4) visible boxes.
    size : (LABEL_COUNT, 2) size of an element whose label has no grid.
    ratios : (K, 2) size to spacing in the database, horizontal and vertical.
    labels : (LABEL_COUNT,) frequency of the labels in the database.
    ground : y of the ground line of doors and shops.
    """

    box: Float64Array
    label: Int64Array
    grid: Int64Array
    spacing: Float64Array
    gaps: BoolArray
    grids: int
    domain: Float64Array
    region: Float64Array
    size: Float64Array
    ratios: Float64Array
    labels: Float64Array
    ground: float


@njit()
def neighbour_distance(box: Float64Array, grid: Int64Array, n: int, at: int, axis: int, sign: int) -> float:
    """Return the centre distance to the next element of the grid in a direction, -1 without one.

    Parameters
    ----------
    box : (N, 4) x0, y0, x1, y1.
    grid : (N,) grid index of each element.
    n : number of elements to consider.
    at : index of the element.
    axis : 0 for x, 1 for y.
    sign : 1 for right or down, -1 for left or up.
    """
    other = 1 - axis
    best = np.inf
    side = box[at, other + 2] - box[at, other]
    own, line = box[at, axis] + box[at, axis + 2], box[at, other] + box[at, other + 2]
    for j in range(n):
        if grid[j] == grid[at] and j != at and abs(box[j, other] + box[j, other + 2] - line) < 0.7 * side:
            away = sign * (box[j, axis] + box[j, axis + 2] - own) / 2
            if 0 < away < best:
                best = away
    return best if best < np.inf else -1.0


@njit()
def next_element_distances(box: Float64Array, grid: Int64Array) -> Float64Array:
    """Return the distance from each element to the next one to the right and below in its grid.

    Parameters
    ----------
    box : (N, 4) x0, y0, x1, y1.
    grid : (N,) grid index of each element.

    Returns
    -------
    (N, 2) centre distances, -1 without a next element.
    """
    out = np.empty((len(box), 2))
    for i in range(len(box)):
        for axis in range(2):
            out[i, axis] = neighbour_distance(box, grid, len(box), i, axis, 1)
    return out


@njit()
def sample_spacing(own: int, axis: int, start: ObservedLayoutArrays) -> float:
    """Draw an observed spacing of the seed element's grid, else of any; -1 without one."""
    for attempt in range(8):
        i = np.random.randint(len(start.box))
        if (attempt >= 4 or start.grid[i] == own) and start.spacing[i, axis] > 0:
            spacing: float = start.spacing[i, axis]
            return spacing
    return -1.0


@njit()
def _add_line(lines: Float64Array, count: int, value: float, near: float) -> int:
    """Add a line to the first `count` unless one is near it; return the new number of lines."""
    for k in range(count):
        if abs(lines[k] - value) < near:
            return count
    lines[count] = value
    return count + 1


@njit()
def nearest_empty_cell(
    box: Float64Array, grid: Int64Array, n: int, at: int, x: float, y: float, width: float, height: float
) -> tuple[bool, float, float]:
    """Find the empty grid cell nearest to the seed element on its row or column.

    The other line of the cell must be a line of the grid, so that the cell does not enlarge the grid's bounding box.

    Parameters
    ----------
    box : (N, 4) x0, y0, x1, y1.
    grid : (N,) grid index of each element.
    n : number of elements to consider.
    at : index of the seed element.
    x, y, width, height : its centre and size.

    Returns
    -------
    True if there is one, and its centre x, y.
    """
    best, best_x, best_y = np.inf, 0.0, 0.0
    own = grid[at]
    xs, ys = np.empty(n), np.empty(n)
    columns, rows = 0, 0
    for j in range(n):
        if grid[j] == own:
            cx, cy = (box[j, 0] + box[j, 2]) / 2, (box[j, 1] + box[j, 3]) / 2
            columns = _add_line(xs, columns, cx, 0.35 * width)
            rows = _add_line(ys, rows, cy, 0.35 * height)
    for k in range(columns + rows):
        px, py = (xs[k], y) if k < columns else (x, ys[k - columns])
        away = abs(px - x) / width + abs(py - y) / height
        if away < 0.7 or away >= best:
            continue
        free = True
        for j in range(n):
            in_column = grid[j] == own and abs((box[j, 0] + box[j, 2]) / 2 - px) < 0.7 * width
            if in_column and abs((box[j, 1] + box[j, 3]) / 2 - py) < 0.7 * height:
                free = False
                break
        if free:
            best, best_x, best_y = away, px, py
    return best < np.inf, best_x, best_y


@njit()
def mark_elements_beside_gaps(box: Float64Array, grid: Int64Array) -> BoolArray:
    """Mark, (N,) bool, the elements next to an empty cell of their grid (Eq. 23)."""
    out = np.empty(len(box), np.bool_)
    for i in range(len(box)):
        x, y = (box[i, 0] + box[i, 2]) / 2, (box[i, 1] + box[i, 3]) / 2
        out[i] = nearest_empty_cell(box, grid, len(box), i, x, y, box[i, 2] - box[i, 0], box[i, 3] - box[i, 1])[0]
    return out


@njit()
def first_size_in_grid(
    box: Float64Array, grid: Int64Array, n: int, own: int, otherwise: Float64Array
) -> tuple[float, float]:
    """Return width and height of an element of a grid, `otherwise` if the grid has none."""
    for i in range(n):
        if own >= 0 and grid[i] == own:
            return box[i, 2] - box[i, 0], box[i, 3] - box[i, 1]
    return otherwise[0], otherwise[1]


@njit()
def snap_to_lines(
    box: Float64Array, label: Int64Array, n: int, x: float, y: float, width: float, height: float
) -> tuple[float, float]:
    """Return the centre moved to the nearest centre lines of other elements."""
    best_x, best_y = _SNAP_SHARE * width, _SNAP_SHARE * height
    to_x, to_y = x, y
    for j in range(n):
        if label[j] != NULL:
            cx, cy = (box[j, 0] + box[j, 2]) / 2, (box[j, 1] + box[j, 3]) / 2
            if abs(cx - x) < best_x:
                best_x, to_x = abs(cx - x), cx
            if abs(cy - y) < best_y:
                best_y, to_y = abs(cy - y), cy
    return to_x, to_y


@njit()
def place_element(
    box: Float64Array,
    label: Int64Array,
    grid: Int64Array,
    n: int,
    x: float,
    y: float,
    width: float,
    height: float,
    chosen: int,
    own: int,
    start: ObservedLayoutArrays,
) -> bool:
    """Write the element at index n if its place is free; return whether it was.

    The visible region, the domain and other elements are hard constraints.
    """
    x0, y0, x1, y1 = x - width / 2, y - height / 2, x + width / 2, y + height / 2
    d = start.domain
    if x0 < d[0] or y0 < d[1] or x1 > d[2] or y1 > d[3]:
        return False
    for r in start.region:
        if x0 < r[2] and r[0] < x1 and y0 < r[3] and r[1] < y1:
            return False
    for j in range(n):
        if x0 < box[j, 2] and box[j, 0] < x1 and y0 < box[j, 3] and box[j, 1] < y1:
            pair = (chosen == WINDOW and label[j] == BALCONY) or (chosen == BALCONY and label[j] == WINDOW)
            if not pair:
                return False
    box[n, 0], box[n, 1], box[n, 2], box[n, 3] = x0, y0, x1, y1
    label[n], grid[n] = chosen, own
    return True


@njit()
def compute_grid_areas(box: Float64Array, grid: Int64Array, n: int, domain: Float64Array, out: Float64Array) -> None:
    """Write the area of each grid's bounding box as a share of the domain, for Eq. 23."""
    whole = (domain[2] - domain[0]) * (domain[3] - domain[1])
    for g in range(len(out)):
        x0, y0, x1, y1 = np.inf, np.inf, -np.inf, -np.inf
        for i in range(n):
            if grid[i] == g:
                x0, y0 = min(x0, box[i, 0]), min(y0, box[i, 1])
                x1, y1 = max(x1, box[i, 2]), max(y1, box[i, 3])
        out[g] = (x1 - x0) * (y1 - y0) / whole if x1 > x0 else 0.0
