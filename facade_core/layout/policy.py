"""The planning policy of Fan et al. 2014, section 5.1: a layout is completed by adding one element after another, compiled.

A policy is a (15,) float64 array: lambda_0 to lambda_2, the five directions in order of priority (lambda_3), lambda_4 to
lambda_10. As in the paper an action adds an element, none moves or deletes one; the reward is the layout's score at the
end, so a candidate is measured once. Doors and shops stand on the ground: they extend to the sides only.
"""

# ruff: noqa: NPY002  (compiled code has its own copy of the legacy generator, seeded at each roll-out)

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from facade_core.layout.proposals import BALCONY, DOOR, SHOP, WINDOW

RANDOM_SEED, CONCAVITY, RANDOM_DIRECTION = 0, 1, 2
PRIORITY = slice(3, 8)
COPY_LABEL, OBSERVED_LABEL, DATABASE_LABEL, COPY_SPACING, OBSERVED_SPACING, SNAP, MIRROR = range(8, 15)
LENGTH = 15
LEFT, RIGHT, UP, DOWN, FILL = range(5)
# A NULL element takes up space and is no part of the layout.
NULL = 4
# At most so many elements are added.
ROOM = 160
# The random offset of a sampled spacing, standard deviation as its share.
_OFFSET = 0.1
# An element snaps to the centre of another nearer than this share of its size.
_SNAPPED = 0.4


class Start(NamedTuple):
    """The observed layout as `roll_out` takes it.

    box (N, 4), label (N,), grid (N,); grids: how many; domain (4,); region (M, 4), what is visible; size (LABELS, 2): of an
    element where its label has no grid; ratios (K, 2): size to spacing in the database, horizontal and vertical;
    labels (LABELS,): shares of the labels in the database; ground: where doors and shops stand.
    """

    box: np.ndarray
    label: np.ndarray
    grid: np.ndarray
    grids: int
    domain: np.ndarray
    region: np.ndarray
    size: np.ndarray
    ratios: np.ndarray
    labels: np.ndarray
    ground: float


@njit(cache=True)
def roll_out(policy: np.ndarray, start: Start, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Complete the layout once: box (N', 4), label (N',), grid (N',), the observed elements first."""
    np.random.seed(seed)
    observed = len(start.box)
    capacity = observed + ROOM
    box, label = np.empty((capacity, 4)), np.empty(capacity, np.int64)
    grid, tried = np.empty(capacity, np.int64), np.zeros(capacity, np.int64)
    box[:observed], label[:observed], grid[:observed] = start.box, start.label, start.grid
    n, grids = observed, start.grids
    grid_of = np.full(4, -1, np.int64)
    for i in range(observed - 1, -1, -1):
        grid_of[label[i]] = grid[i]
    area = np.zeros(start.grids + 4)
    _grid_areas(box, grid, n, start.domain, area)
    while n < capacity - 2:
        seed_at = _seed(policy, box, label, grid, tried, n, area)
        if seed_at < 0:
            break
        way = _direction(policy, tried[seed_at])
        tried[seed_at] |= 1 << way
        kind = label[seed_at]
        if (kind in (DOOR, SHOP)) and (way in (UP, DOWN)):
            continue
        found, x, y = _place(policy, box, label, grid, n, observed, seed_at, way, start)
        if not found:
            continue
        chosen = kind if way == FILL else _label(policy, start, observed, kind)
        width, height = box[seed_at, 2] - box[seed_at, 0], box[seed_at, 3] - box[seed_at, 1]
        own = grid[seed_at]
        if chosen != kind and chosen != NULL:
            own = grid_of[chosen]
            width, height = _size(box, grid, n, own, start.size[chosen])
            if chosen in (DOOR, SHOP):
                y = start.ground - height / 2
        if np.random.random() < policy[SNAP]:
            x, y = _snapped(box, label, n, x, y, width, height)
        if _add(box, label, grid, n, x, y, width, height, chosen, own, start):
            if chosen != NULL and own < 0:
                grid_of[chosen] = grid[n] = grids
                grids += 1
            n += 1
        if np.random.random() < policy[MIRROR]:
            middle = (start.domain[0] + start.domain[2]) / 2
            x = 2 * middle - (box[seed_at, 0] + box[seed_at, 2]) / 2
            y = (box[seed_at, 1] + box[seed_at, 3]) / 2
            width, height = box[seed_at, 2] - box[seed_at, 0], box[seed_at, 3] - box[seed_at, 1]
            n += _add(box, label, grid, n, x, y, width, height, kind, grid[seed_at], start)
    kept = np.flatnonzero(label[:n] != NULL)
    return box[kept], label[kept], grid[kept]


@njit(cache=True)
def _seed(
    policy: np.ndarray,
    box: np.ndarray,
    label: np.ndarray,
    grid: np.ndarray,
    tried: np.ndarray,
    n: int,
    area: np.ndarray,
) -> int:
    """The seed element, among those with a direction left: at random or by the rank of Eq. 23; -1 where none is left."""
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
            # an element inside its grid's box has neighbours all around it or a gap: its fill is still to be tried
            concave = 0.0 if tried[i] & (1 << FILL) else 1.0
            rank = policy[CONCAVITY] * concave + (1 - policy[CONCAVITY]) * (1 - area[grid[i]])
            if rank > best_rank:
                best, best_rank = i, rank
    return best


@njit(cache=True)
def _direction(policy: np.ndarray, tried: int) -> int:
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


@njit(cache=True)
def _label(policy: np.ndarray, start: Start, observed: int, kind: int) -> int:
    """lambda_4: the seed's own; else lambda_5 sampled from the observed, lambda_6 from the database, or NULL."""
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


@njit(cache=True)
def _place(
    policy: np.ndarray,
    box: np.ndarray,
    label: np.ndarray,
    grid: np.ndarray,
    n: int,
    observed: int,
    seed_at: int,
    way: int,
    start: Start,
) -> tuple[bool, float, float]:
    """The new element's centre; False where the direction has none."""
    x, y = (box[seed_at, 0] + box[seed_at, 2]) / 2, (box[seed_at, 1] + box[seed_at, 3]) / 2
    width, height = box[seed_at, 2] - box[seed_at, 0], box[seed_at, 3] - box[seed_at, 1]
    if way == FILL:
        return _gap(box, grid, n, seed_at, x, y, width, height)
    axis, sign = (0, 1) if way == RIGHT else (0, -1) if way == LEFT else (1, 1) if way == DOWN else (1, -1)
    spacing = -1.0
    u = np.random.random()
    if u < policy[COPY_SPACING]:
        spacing = _neighbour(box, grid, n, seed_at, axis, -sign)
    if spacing < 0:
        spacing = _observed_spacing(box, grid, observed, grid[seed_at], axis, start)
        if spacing < 0:
            size = width if axis == 0 else height
            spacing = size / start.ratios[np.random.randint(len(start.ratios)), axis]
        if u >= policy[COPY_SPACING] + policy[OBSERVED_SPACING]:
            spacing *= 1 + _OFFSET * np.random.standard_normal()
    if axis == 0:
        return True, x + sign * spacing, y
    return True, x, y + sign * spacing


@njit(cache=True)
def _neighbour(box: np.ndarray, grid: np.ndarray, n: int, at: int, axis: int, sign: int) -> float:
    """Centre distance to the next element of the grid on that side, on the same line; -1 where there is none."""
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


@njit(cache=True)
def _observed_spacing(box: np.ndarray, grid: np.ndarray, observed: int, own: int, axis: int, start: Start) -> float:
    """A spacing of the seed's grid as seen, drawn at random, else of any grid; -1 where none is seen."""
    for attempt in range(8):
        i = np.random.randint(observed)
        if attempt < 4 and grid[i] != own:
            continue
        spacing = _neighbour(start.box, start.grid, observed, i, axis, 1)
        if spacing > 0:
            return spacing
    return -1.0


@njit(cache=True)
def _gap(
    box: np.ndarray, grid: np.ndarray, n: int, at: int, x: float, y: float, width: float, height: float
) -> tuple[bool, float, float]:
    """The nearest empty cell on the seed's row or column whose other line the grid has: its box does not grow by it."""
    best, best_x, best_y = np.inf, 0.0, 0.0
    own = grid[at]
    for j in range(n):
        if grid[j] != own or j == at:
            continue
        cx, cy = (box[j, 0] + box[j, 2]) / 2, (box[j, 1] + box[j, 3]) / 2
        for turn in range(2):
            px, py = (cx, y) if turn == 0 else (x, cy)
            away = abs(px - x) / width + abs(py - y) / height
            if away < 0.7 or away >= best:
                continue
            free = True
            for k in range(n):
                in_column = grid[k] == own and abs((box[k, 0] + box[k, 2]) / 2 - px) < 0.7 * width
                if in_column and abs((box[k, 1] + box[k, 3]) / 2 - py) < 0.7 * height:
                    free = False
                    break
            if free:
                best, best_x, best_y = away, px, py
    return best < np.inf, best_x, best_y


@njit(cache=True)
def _size(box: np.ndarray, grid: np.ndarray, n: int, own: int, otherwise: np.ndarray) -> tuple[float, float]:
    for i in range(n):
        if own >= 0 and grid[i] == own:
            return box[i, 2] - box[i, 0], box[i, 3] - box[i, 1]
    return otherwise[0], otherwise[1]


@njit(cache=True)
def _snapped(
    box: np.ndarray, label: np.ndarray, n: int, x: float, y: float, width: float, height: float
) -> tuple[float, float]:
    best_x, best_y = _SNAPPED * width, _SNAPPED * height
    to_x, to_y = x, y
    for j in range(n):
        if label[j] != NULL:
            cx, cy = (box[j, 0] + box[j, 2]) / 2, (box[j, 1] + box[j, 3]) / 2
            if abs(cx - x) < best_x:
                best_x, to_x = abs(cx - x), cx
            if abs(cy - y) < best_y:
                best_y, to_y = abs(cy - y), cy
    return to_x, to_y


@njit(cache=True)
def _add(
    box: np.ndarray,
    label: np.ndarray,
    grid: np.ndarray,
    n: int,
    x: float,
    y: float,
    width: float,
    height: float,
    chosen: int,
    own: int,
    start: Start,
) -> bool:
    """Write the element at index n if its place is free; what is seen, the domain and other elements are hard constraints."""
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


@njit(cache=True)
def _grid_areas(box: np.ndarray, grid: np.ndarray, n: int, domain: np.ndarray, out: np.ndarray) -> None:
    """Area of each grid's bounding box as a share of the domain, for Eq. 23."""
    whole = (domain[2] - domain[0]) * (domain[3] - domain[1])
    for g in range(len(out)):
        x0, y0, x1, y1 = np.inf, np.inf, -np.inf, -np.inf
        for i in range(n):
            if grid[i] == g:
                x0, y0 = min(x0, box[i, 0]), min(y0, box[i, 1])
                x1, y1 = max(x1, box[i, 2]), max(y1, box[i, 3])
        out[g] = (x1 - x0) * (y1 - y0) / whole if x1 > x0 else 0.0
