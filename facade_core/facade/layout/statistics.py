"""Statistics under the ten scores: spacing, alignment, border and symmetry of a layout's grids.

Compiled, since `measure_layout` runs for every candidate. Elements are arrays: box (N, 4) x0, y0, x1, y1; label
(N,) index into ELEMENT_CLASSES; grid (N,) grid index, numbered from 0 without holes. The code uses loops: numba's
sort, median and unique, slice assignments and array expressions take longer to compile than their callers.

References
----------
Fan et al. 2014, sections 4.1-4.3.
"""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Float64Array, Int64Array
from facade_core.core.labels import ELEMENT_CLASSES
from facade_core.core.numba_cache import njit
from facade_core.core.small_sort import argsort_few
from facade_core.facade.layout.grids import ALIGNMENT_TOLERANCE
from facade_core.facade.layout.rectangles import DOOR

LABEL_COUNT = len(ELEMENT_CLASSES)
# Interleaving patterns of Eq. 5, repeated over two grids; the last is any other.
PATTERNS = ("AB", "ABA", "AAB", "AABB", "other")

# Columns of the arrays that `measure_layout` returns; NaN where a term does not apply.
ASPECT, WIDTH_RATIO, HEIGHT_RATIO, REGULAR_X, REGULAR_Y, COMPLETE, LABEL = range(7)
PATTERN, ALIGN_X, GAP_X, ALIGN_Y, GAP_Y = range(5)
COVERAGE, BORDER_LEFT, BORDER_RIGHT, BORDER_TOP, BORDER_BOTTOM, SYMMETRY, DOOR_AT, TYPES = range(8)
UNARY_SIZE, PAIR_SIZE, OVERALL_SIZE = 7, 5, 8
# Element types of Eq. 7-8: each label above the ground, then each on the ground. With labels alone the term would only
# count labels, and a door on the third floor would raise it.
ELEMENT_TYPE_COUNT = 2 * LABEL_COUNT
# Largest distance of an element on the ground from the domain's foot, as a share of its height.
_MAX_GROUND_GAP = 0.5


@njit(cache=True)
def cluster_positions_compiled(values: Float64Array, gap: float) -> Float64Array:
    """Cluster positions whose neighbours differ by at most `gap`, in compiled code.

    Parameters
    ----------
    values : (N,) positions in any order.
    gap : largest distance between neighbours of one cluster.

    Returns
    -------
    (K,) cluster means, ascending.
    """
    order = argsort_few(values)
    means = np.empty(len(values))
    count, total, k = 0, 0.0, -1
    for j in range(len(order)):
        v = values[order[j]]
        if j == 0 or v - values[order[j - 1]] > gap:
            k += 1
            count, total = 0, 0.0
        count += 1
        total += v
        means[k] = total / count
    return means[: k + 1]


@njit(cache=True)
def _median(values: Float64Array) -> float:
    order = argsort_few(values)
    middle = len(values) // 2
    upper: float = values[order[middle]]
    if len(values) % 2:
        return upper
    mean: float = (values[order[middle - 1]] + upper) / 2
    return mean


@njit(cache=True)
def measure_layout(
    box: Float64Array, label: Int64Array, grid: Int64Array, domain: Float64Array
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Measure the statistics of a layout.

    Parameters
    ----------
    box : (N, 4) x0, y0, x1, y1.
    label : (N,) index into ELEMENT_CLASSES.
    grid : (N,) grid index of each element.
    domain : (4,) x0, y0, x1, y1 of the facade.

    Returns
    -------
    (grids, UNARY_SIZE), (pairs, PAIR_SIZE) and (OVERALL_SIZE,) float64, NaN where a term does not apply.
    """
    n = len(box)
    grids = 0
    for i in range(n):
        grids = max(grids, grid[i] + 1)
    unary = np.full((grids, UNARY_SIZE), np.nan)
    extent = np.empty((grids, 4))
    size = np.empty((grids, 2))
    of_label = np.empty(grids, np.int64)
    columns = np.empty((grids, n))
    rows = np.empty((grids, n))
    column_count, row_count = np.zeros(grids, np.int64), np.zeros(grids, np.int64)
    middle_x, middle_y, wide, high = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for g in range(grids):
        count = 0
        for i in range(n):
            if grid[i] == g:
                x0, y0, x1, y1 = box[i, 0], box[i, 1], box[i, 2], box[i, 3]
                if count == 0:
                    of_label[g] = label[i]
                    extent[g, 0], extent[g, 1], extent[g, 2], extent[g, 3] = x0, y0, x1, y1
                extent[g, 0], extent[g, 1] = min(extent[g, 0], x0), min(extent[g, 1], y0)
                extent[g, 2], extent[g, 3] = max(extent[g, 2], x1), max(extent[g, 3], y1)
                middle_x[count], middle_y[count] = (x0 + x1) / 2, (y0 + y1) / 2
                wide[count], high[count] = x1 - x0, y1 - y0
                count += 1
        width, height = _median(wide[:count]), _median(high[:count])
        size[g, 0], size[g, 1] = width, height
        xs = cluster_positions_compiled(middle_x[:count], ALIGNMENT_TOLERANCE * width)
        ys = cluster_positions_compiled(middle_y[:count], ALIGNMENT_TOLERANCE * height)
        column_count[g], row_count[g] = len(xs), len(ys)
        for k in range(len(xs)):
            columns[g, k] = xs[k]
        for k in range(len(ys)):
            rows[g, k] = ys[k]
        _measure_grid(unary[g], count, width, height, xs, ys)
        unary[g, LABEL] = of_label[g]
    pairs = np.full((grids * (grids - 1) // 2, PAIR_SIZE), np.nan)
    k = 0
    for i in range(grids):
        for j in range(i + 1, grids):
            _measure_pair(
                pairs[k],
                columns[i, : column_count[i]],
                columns[j, : column_count[j]],
                rows[i, : row_count[i]],
                rows[j, : row_count[j]],
                extent[i],
                extent[j],
                size[i],
                size[j],
                domain,
            )
            k += 1
    return unary, pairs, _measure_whole(box, label, extent, domain)


@njit(cache=True, inline="always")
def _measure_grid(
    out: Float64Array, count: int, width: float, height: float, xs: Float64Array, ys: Float64Array
) -> None:
    """Write Eq. 1-4 of one grid: aspect ratio, size to spacing, relative spread of the spacing, completeness.

    The paper divides the spread by the grid's extent; with ten columns that hardly changes if one moves by half a
    window.
    """
    out[ASPECT] = np.log(height / width)
    if len(xs) > 1:
        mean, deviation = _spacing_moments(xs)
        out[WIDTH_RATIO] = width / mean
        out[REGULAR_X] = deviation / mean
    if len(ys) > 1:
        mean, deviation = _spacing_moments(ys)
        out[HEIGHT_RATIO] = height / mean
        out[REGULAR_Y] = deviation / mean
    out[COMPLETE] = count / (len(xs) * len(ys))


@njit(cache=True)
def _spacing_moments(lines: Float64Array) -> tuple[float, float]:
    """Return mean and standard deviation of the distances between successive lines."""
    count = len(lines) - 1
    mean, spread = 0.0, 0.0
    for k in range(count):
        mean += lines[k + 1] - lines[k]
    mean /= count
    for k in range(count):
        spread += (lines[k + 1] - lines[k] - mean) ** 2
    return mean, np.sqrt(spread / count)


@njit(cache=True)
def _measure_pair(
    out: Float64Array,
    xa: Float64Array,
    xb: Float64Array,
    ya: Float64Array,
    yb: Float64Array,
    a: Float64Array,
    b: Float64Array,
    size_a: Float64Array,
    size_b: Float64Array,
    domain: Float64Array,
) -> None:
    """Write Eq. 5-6 of two grids: interleaving pattern, and share of overlapping lines that align, with the gap."""
    apart_x = max(a[0], b[0]) - min(a[2], b[2])
    apart_y = max(a[1], b[1]) - min(a[3], b[3])
    if apart_x < 0 and apart_y < 0:  # the bounding boxes overlap, so their lines may alternate
        pattern = _interleaving_pattern(xa, xb, ALIGNMENT_TOLERANCE * min(size_a[0], size_b[0]))
        if pattern < 0:
            pattern = _interleaving_pattern(ya, yb, ALIGNMENT_TOLERANCE * min(size_a[1], size_b[1]))
        if pattern >= 0:
            out[PATTERN] = pattern
    if apart_x < 0:
        share = _aligned_share(xa, xb, ALIGNMENT_TOLERANCE * min(size_a[0], size_b[0]), a[0], a[2], b[0], b[2])
        if share >= 0:
            out[ALIGN_Y], out[GAP_Y] = share, max(0.0, apart_y) / (domain[3] - domain[1])
    if apart_y < 0:
        share = _aligned_share(ya, yb, ALIGNMENT_TOLERANCE * min(size_a[1], size_b[1]), a[1], a[3], b[1], b[3])
        if share >= 0:
            out[ALIGN_X], out[GAP_X] = share, max(0.0, apart_x) / (domain[2] - domain[0])


@njit(cache=True)
def _aligned_share(p: Float64Array, q: Float64Array, gap: float, a0: float, a1: float, b0: float, b1: float) -> float:
    """Return the share of lines in the common stretch that have a partner, -1 without a line there."""
    low, high = max(a0, b0), min(a1, b1)
    overlapping, aligned = 0, 0
    for k in range(len(p)):
        if low <= p[k] <= high:
            near = False
            for j in range(len(q)):
                near = near or abs(q[j] - p[k]) <= gap
            overlapping += 1
            aligned += near
    for j in range(len(q)):
        if low <= q[j] <= high:
            near = False
            for k in range(len(p)):
                near = near or abs(q[j] - p[k]) <= gap
            overlapping += not near  # a line with a partner is counted already
    return aligned / overlapping if overlapping else -1.0


@njit(cache=True)
def _unmatched_lines(p: Float64Array, q: Float64Array, gap: float) -> Float64Array:
    """Return the lines of p without a line of q within the gap."""
    out = np.empty(len(p))
    n = 0
    for k in range(len(p)):
        alone = True
        for j in range(len(q)):
            alone = alone and abs(q[j] - p[k]) > gap
        if alone:
            out[n] = p[k]
            n += 1
    return out[:n]


@njit(cache=True)
def _interleaving_pattern(all_p: Float64Array, all_q: Float64Array, gap: float) -> int:
    """Return the index into PATTERNS of the order in which two grids' lines alternate, -1 if they do not.

    Coincident lines belong to both grids and do not count.
    """
    p, q = _unmatched_lines(all_p, all_q, gap), _unmatched_lines(all_q, all_p, gap)
    n = len(p) + len(q)
    if len(p) == 0 or len(q) == 0:
        return -1
    values = np.empty(n)
    for k in range(len(p)):
        values[k] = p[k]
    for k in range(len(q)):
        values[len(p) + k] = q[k]
    order = argsort_few(values)
    turns, first = 0, order[0] >= len(p)
    runs = np.zeros(n, np.int64)
    previous = first
    for k in range(n):
        second = order[k] >= len(p)
        if second != previous:
            turns += 1
            previous = second
        runs[turns] += 1
    if turns <= 1:
        return -1
    ones, pairs, short = True, True, runs[0] <= 2 and runs[turns] <= 2
    # For the runs at even and at odd places: all of length one; all of length two, the first and the last at most two.
    single, double = np.ones(2, np.bool_), np.ones(2, np.bool_)
    for k in range(turns + 1):
        side = k % 2
        ones &= runs[k] == 1
        single[side] &= runs[k] == 1
        if 0 < k < turns:
            pairs &= runs[k] == 2
        double[side] &= runs[k] == 2 if 0 < k < turns else runs[k] <= 2
    if ones:
        return 1 if turns == 2 else 0
    if pairs and short:
        return 3
    if (double[0] and single[1]) or (double[1] and single[0]):
        return 2
    return 4


@njit(cache=True)
def _measure_whole(box: Float64Array, label: Int64Array, extent: Float64Array, domain: Float64Array) -> Float64Array:
    """Write Eq. 8-11: types present as bits, coverage, borders in mean element sizes, symmetric share, door position."""
    out = np.full(OVERALL_SIZE, np.nan)
    n = len(box)
    types = 0
    for i in range(n):
        standing = domain[3] - box[i, 3] < _MAX_GROUND_GAP * (box[i, 3] - box[i, 1])
        types |= 1 << (label[i] + LABEL_COUNT * standing)
    out[TYPES] = types
    width, height = domain[2] - domain[0], domain[3] - domain[1]
    if n == 0:
        out[COVERAGE] = 0.0
        return out
    out[COVERAGE] = _union_area(extent) / (width * height)
    w, h = 0.0, 0.0
    left, top, right, bottom = np.inf, np.inf, -np.inf, -np.inf
    doors, at = 0, 0.0
    for i in range(n):
        w += box[i, 2] - box[i, 0]
        h += box[i, 3] - box[i, 1]
        left, top = min(left, box[i, 0]), min(top, box[i, 1])
        right, bottom = max(right, box[i, 2]), max(bottom, box[i, 3])
        if label[i] == DOOR:
            doors += 1
            at += ((box[i, 0] + box[i, 2]) / 2 - domain[0]) / width
    w, h = w / n, h / n
    out[BORDER_LEFT], out[BORDER_RIGHT] = (left - domain[0]) / w, (domain[2] - right) / w
    out[BORDER_TOP], out[BORDER_BOTTOM] = (top - domain[1]) / h, (domain[3] - bottom) / h
    out[DOOR_AT] = at / doors if doors else 0.0
    out[SYMMETRY] = symmetric_share(box, label, domain)
    return out


@njit(cache=True)
def symmetric_share(box: Float64Array, label: Int64Array, domain: Float64Array) -> float:
    """Return the share of element area whose mirror image meets an element of the same label.

    Parameters
    ----------
    box : (N, 4) x0, y0, x1, y1.
    label : (N,) index into ELEMENT_CLASSES.
    domain : (4,) x0, y0, x1, y1 of the facade; its middle is the axis.
    """
    twice = domain[0] + domain[2]
    met, total = 0.0, 0.0
    for i in range(len(box)):
        area = (box[i, 2] - box[i, 0]) * (box[i, 3] - box[i, 1])
        total += area
        low, high = twice - box[i, 2], twice - box[i, 0]
        best = 0.0
        for j in range(len(box)):
            if label[j] == label[i]:
                dx = min(high, box[j, 2]) - max(low, box[j, 0])
                dy = min(box[i, 3], box[j, 3]) - max(box[i, 1], box[j, 1])
                if dx > 0 and dy > 0:
                    best = max(best, dx * dy)
        met += best
    return min(1.0, met / total)


@njit(cache=True)
def _union_area(rectangles: Float64Array) -> float:
    """Return the area of the union of rectangles."""
    count = len(rectangles)
    xs, ys = np.empty(2 * count), np.empty(2 * count)
    for r in range(count):
        xs[2 * r], xs[2 * r + 1] = rectangles[r, 0], rectangles[r, 2]
        ys[2 * r], ys[2 * r + 1] = rectangles[r, 1], rectangles[r, 3]
    by_x, by_y = argsort_few(xs), argsort_few(ys)
    area = 0.0
    for i in range(2 * count - 1):
        x0, x1 = xs[by_x[i]], xs[by_x[i + 1]]
        for j in range(2 * count - 1):
            y0, y1 = ys[by_y[j]], ys[by_y[j + 1]]
            for r in range(count):
                e = rectangles[r]
                if e[0] <= x0 and x1 <= e[2] and e[1] <= y0 and y1 <= e[3]:
                    area += (x1 - x0) * (y1 - y0)
                    break
    return area
