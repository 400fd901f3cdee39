"""Planning policy that completes a layout by adding one element after another; compiled.

A policy is a (15,) float64 array: lambda_0 to lambda_2, the five extension directions in order of priority
(lambda_3), lambda_4 to lambda_10. As in the paper an action adds an element, none moves or deletes one. The
reward is the layout's score at the end, so a candidate is measured once. Doors and shops are on the ground: they
extend to the sides only.

References
----------
Fan et al. 2014, section 5.1.
"""

# ruff: noqa: NPY002  (compiled code has its own copy of the legacy generator, seeded at each roll-out)

from __future__ import annotations

import numpy as np

from benchmarks.papers.placement import (
    NULL,
    ObservedLayoutArrays,
    compute_grid_areas,
    first_size_in_grid,
    nearest_empty_cell,
    neighbour_distance,
    place_element,
    sample_spacing,
    snap_to_lines,
)
from facade_core.core.arrays import BoolArray, Float64Array, Int64Array
from facade_core.core.numba_cache import njit
from facade_core.facade.layout.rectangles import DOOR, SHOP, WINDOW

RANDOM_SEED, CONCAVITY, RANDOM_DIRECTION = 0, 1, 2
PRIORITY = slice(3, 8)
COPY_LABEL, OBSERVED_LABEL, DATABASE_LABEL, COPY_SPACING, OBSERVED_SPACING, SNAP, MIRROR = range(8, 15)
LEFT, RIGHT, UP, DOWN, FILL = range(5)
# Most elements that a roll-out adds.
MAX_ADDED_ELEMENTS = 160
# Standard deviation of the random offset of a sampled spacing, as its share.
_OFFSET_SHARE = 0.1


@njit()
def roll_out_policy(
    policy: Float64Array, start: ObservedLayoutArrays, seed: int
) -> tuple[Float64Array, Int64Array, Int64Array]:
    """Complete the layout once with a policy.

    Parameters
    ----------
    policy : (POLICY_LENGTH,) parameters.
    start : observed layout.
    seed : seed of the generator of compiled code.

    Returns
    -------
    box (N', 4), label (N',) and grid (N',) of all elements, the observed ones first.
    """
    np.random.seed(seed)
    observed = len(start.box)
    capacity = observed + MAX_ADDED_ELEMENTS
    box, label = np.empty((capacity, 4)), np.empty(capacity, np.int64)
    grid, tried = np.empty(capacity, np.int64), np.zeros(capacity, np.int64)
    for i in range(observed):
        _copy_element(box, label, grid, i, start.box, start.label, start.grid, i)
    n, grids = observed, start.grids
    grid_of = np.full(4, -1, np.int64)
    for i in range(observed - 1, -1, -1):
        grid_of[label[i]] = grid[i]
    area = np.zeros(start.grids + 4)
    compute_grid_areas(box, grid, n, start.domain, area)
    while n < capacity - 2:
        seed_at = _select_seed(policy, box, label, grid, tried, n, area, start.gaps)
        if seed_at < 0:
            break
        way = _select_direction(policy, tried[seed_at])
        tried[seed_at] |= 1 << way
        kind = label[seed_at]
        if (kind in (DOOR, SHOP)) and (way in (UP, DOWN)):
            continue
        found, x, y = _extension_centre(policy, box, label, grid, n, seed_at, way, start)
        if not found:
            if way == FILL:
                # This row has no gap, so its other elements need not search; gaps of other rows are found from there.
                height = box[seed_at, 3] - box[seed_at, 1]
                for j in range(n):
                    if grid[j] == grid[seed_at] and abs(box[j, 1] - box[seed_at, 1]) < height:
                        tried[j] |= 1 << FILL
            continue
        chosen = kind if way == FILL else _select_label(policy, start, observed, kind)
        width, height = box[seed_at, 2] - box[seed_at, 0], box[seed_at, 3] - box[seed_at, 1]
        own = grid[seed_at]
        if chosen != kind and chosen != NULL:
            own = grid_of[chosen]
            width, height = first_size_in_grid(box, grid, n, own, start.size[chosen])
            if chosen in (DOOR, SHOP):
                y = start.ground - height / 2
        if np.random.random() < policy[SNAP]:
            x, y = snap_to_lines(box, label, n, x, y, width, height)
        if place_element(box, label, grid, n, x, y, width, height, chosen, own, start):
            if chosen != NULL and own < 0:
                grid_of[chosen] = grid[n] = grids
                grids += 1
            n += 1
        if np.random.random() < policy[MIRROR]:
            middle = (start.domain[0] + start.domain[2]) / 2
            x = 2 * middle - (box[seed_at, 0] + box[seed_at, 2]) / 2
            y = (box[seed_at, 1] + box[seed_at, 3]) / 2
            width, height = box[seed_at, 2] - box[seed_at, 0], box[seed_at, 3] - box[seed_at, 1]
            n += place_element(box, label, grid, n, x, y, width, height, kind, grid[seed_at], start)
    kept = 0
    for i in range(n):
        if label[i] != NULL:
            _copy_element(box, label, grid, kept, box, label, grid, i)
            kept += 1
    return box[:kept], label[:kept], grid[:kept]


@njit()
def _copy_element(
    box: Float64Array,
    label: Int64Array,
    grid: Int64Array,
    at: int,
    of_box: Float64Array,
    of_label: Int64Array,
    of_grid: Int64Array,
    i: int,
) -> None:
    """Copy element i of other arrays to index `at`; numba takes seconds to compile slice assignments."""
    for k in range(4):
        box[at, k] = of_box[i, k]
    label[at], grid[at] = of_label[i], of_grid[i]


@njit()
def _select_seed(
    policy: Float64Array,
    box: Float64Array,
    label: Int64Array,
    grid: Int64Array,
    tried: Int64Array,
    n: int,
    area: Float64Array,
    gaps: BoolArray,
) -> int:
    """Select the seed element among those with a direction left, randomly or by Eq. 23; -1 if none is left."""
    count = 0
    for i in range(n):
        count += tried[i] < 31 and label[i] != NULL
    if count == 0:
        return -1
    if np.random.random() < policy[RANDOM_SEED]:
        skip = np.random.randint(count)
        for i in range(n):
            if tried[i] < 31 and label[i] != NULL:
                if skip == 0:
                    return i
                skip -= 1
    best, best_rank = -1, -1.0
    for i in range(n):
        if tried[i] < 31 and label[i] != NULL:
            # Concave next to a gap of its grid until FILL was tried; added elements are next to others.
            concave = 1.0 if i < len(gaps) and gaps[i] and not tried[i] & (1 << FILL) else 0.0
            rank = policy[CONCAVITY] * concave + (1 - policy[CONCAVITY]) * (1 - area[grid[i]])
            if rank > best_rank:
                best, best_rank = i, rank
    return best


@njit()
def _select_direction(policy: Float64Array, tried: int) -> int:
    if np.random.random() < policy[RANDOM_DIRECTION]:
        while True:
            way = np.random.randint(5)
            if not tried & (1 << way):
                return way
    for k in range(5):
        way = int(policy[3 + k])
        if not tried & (1 << way):
            return way
    return FILL


@njit()
def _select_label(policy: Float64Array, start: ObservedLayoutArrays, observed: int, kind: int) -> int:
    """Select the extension label by lambda_4 to lambda_6: of the seed, observed, of the database, or NULL."""
    if np.random.random() < policy[COPY_LABEL]:
        return kind
    u = np.random.random()
    if u < policy[OBSERVED_LABEL]:
        return int(start.label[np.random.randint(observed)])
    if u < policy[OBSERVED_LABEL] + policy[DATABASE_LABEL]:
        v = np.random.random()
        for k in range(len(start.labels)):
            v -= start.labels[k]
            if v < 0:
                return k
        return WINDOW
    return NULL


@njit()
def _extension_centre(
    policy: Float64Array,
    box: Float64Array,
    label: Int64Array,
    grid: Int64Array,
    n: int,
    seed_at: int,
    way: int,
    start: ObservedLayoutArrays,
) -> tuple[bool, float, float]:
    """Return the new element's centre; False if the direction has none."""
    x, y = (box[seed_at, 0] + box[seed_at, 2]) / 2, (box[seed_at, 1] + box[seed_at, 3]) / 2
    width, height = box[seed_at, 2] - box[seed_at, 0], box[seed_at, 3] - box[seed_at, 1]
    if way == FILL:
        gap: tuple[bool, float, float] = nearest_empty_cell(box, grid, n, seed_at, x, y, width, height)
        return gap
    axis, sign = (0, 1) if way == RIGHT else (0, -1) if way == LEFT else (1, 1) if way == DOWN else (1, -1)
    spacing = -1.0
    u = np.random.random()
    if u < policy[COPY_SPACING]:
        spacing = neighbour_distance(box, grid, n, seed_at, axis, -sign)
    if spacing < 0:
        spacing = sample_spacing(grid[seed_at], axis, start)
        if spacing < 0:
            size = width if axis == 0 else height
            spacing = size / start.ratios[np.random.randint(len(start.ratios)), axis]
        if u >= policy[COPY_SPACING] + policy[OBSERVED_SPACING]:
            spacing *= 1 + _OFFSET_SHARE * np.random.standard_normal()
    if axis == 0:
        return True, x + sign * spacing, y
    return True, x, y + sign * spacing
