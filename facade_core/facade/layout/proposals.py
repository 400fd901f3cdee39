"""Propose elements for the hidden part of a facade: many simple guesses, each with the variants that support it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from facade_core.core.arrays import AnyArray, BoolArray, Float32Array, Float64Array, Int64Array
from facade_core.core.labels import ELEMENT_CLASSES
from facade_core.core.types import Element
from facade_core.facade.layout.facade_frame import ColumnsAndFloors, Rectangle, fit_columns_and_floors
from facade_core.facade.layout.floor_hypotheses import extrapolate_floors, resample_lines
from facade_core.facade.layout.grid_extension import (
    ExtensionVariant,
    add_mirror_columns,
    extend_lines,
    extension_context,
    propose_extension_elements,
)
from facade_core.facade.layout.grids import Grid, box_array
from facade_core.facade.layout.rectangles import (
    BALCONY,
    DOOR,
    SHOP,
    WINDOW,
    best_iou_by_variant,
    labels_may_overlap,
    overlap_mask,
    select_distinct_rectangles,
)

# A guess is moved clear if less than this share of its side is in the visible region or outside the domain.
_MAX_SHIFT_SHARE = 0.3
_NO_GUESSES = np.zeros((0, 5))
# Tried indices of the sixteen quantiles of window size to spacing: wide, usual and close rows.
_RATIO_QUANTILES = [3, 8, 12]
# Most guesses of one variant; the cost is quadratic.
_MAX_VARIANT_GUESSES = 2000
# Most guesses of all variants; a facade of 225 windows has 5,500.
_MAX_GUESSES = 15_000
# Pier between shops as wide as their columns, in window widths.
_PIER_SHARE = 0.3

EXTENSION_VARIANTS = (
    *(ExtensionVariant(mirrored, balanced, False, False) for mirrored, balanced in product((False, True), repeat=2)),
    ExtensionVariant(False, True, True, False),
    ExtensionVariant(False, True, False, True),
)


@dataclass(frozen=True, slots=True, eq=False)
class Proposals:
    """Guesses that overlap no observed element.

    Attributes
    ----------
    box : (N, 4) x0, y0, x1, y1.
    label : (N,) int8 index into ELEMENT_CLASSES.
    support : (N, variants) float32, largest IoU with a guess of the same label of each variant.
    """

    box: Float64Array
    label: AnyArray
    support: Float32Array


@dataclass(frozen=True, slots=True, eq=False)
class ElementPriors:
    """Database statistics for labels, rows and columns without observation.

    Attributes
    ----------
    door_sizes, shop_sizes : (K, 3) width and height in window widths and heights, gap to the ground line in window
        heights.
    floor_progressions : (K, 4) downward progressions of floors, see `extrapolate_floors`.
    size_to_spacing : (K, 2) quantiles of window size to spacing, horizontal and vertical, ascending.
    """

    door_sizes: Float64Array
    shop_sizes: Float64Array
    floor_progressions: Float64Array
    size_to_spacing: Float64Array


def propose_elements(
    observed: Sequence[Element],
    grids: Sequence[Grid],
    domain: Rectangle,
    region: Float64Array,
    priors: ElementPriors,
    entrances: Sequence[float] = (),
) -> Proposals:
    """Propose elements for the hidden part of a facade.

    Parameters
    ----------
    observed : observed elements.
    grids : their grids.
    domain : (x0, y0, x1, y1) of the facade.
    region : (M, 4) visible boxes.
    priors : statistics of the database.
    entrances : x of mapped doors.
    """
    variants: list[Float64Array] = []
    shared = extension_context(observed, grids)
    for how in EXTENSION_VARIANTS:
        variants.append(_guess_array(propose_extension_elements(shared, domain, how)))
    facade = fit_columns_and_floors(observed, domain)
    for balanced, mirror in product((False, True), repeat=2):
        variants.append(_pooled_windows(observed, facade, domain, balanced, mirror))
    variants.append(_mirror_elements(observed, domain))
    variants.append(_ground_elements(observed, facade, domain, DOOR, priors.door_sizes, entrances))
    variants.append(_ground_elements(observed, facade, domain, SHOP, priors.shop_sizes, ()))
    variants.append(_stretch_grids(observed, grids, domain))
    variants.append(_stack_balconies(observed, facade, domain))
    variants += _floor_windows(observed, facade, domain, priors.floor_progressions)
    variants += _pitch_windows(observed, facade, domain, priors.size_to_spacing[_RATIO_QUANTILES])
    most = _MAX_VARIANT_GUESSES if sum(map(len, variants)) <= _MAX_GUESSES else _MAX_GUESSES // len(variants)
    variants = [guesses[:most] for guesses in variants]
    variant = np.repeat(np.arange(len(variants)), [len(guesses) for guesses in variants])
    raw = np.concatenate(variants)
    raw[:, 1:], inside = move_clear(raw[:, 1:], domain, region)
    inside &= avoids_observed(raw, observed)
    raw, variant = raw[inside], variant[inside]
    kept = _unique_guesses(raw)
    support = best_iou_by_variant(raw[kept], raw, variant, len(variants))
    return Proposals(raw[kept, 1:], raw[kept, 0].astype(np.int8), support)


def _guess_array(elements: Iterator[Element]) -> Float64Array:
    rows = [(ELEMENT_CLASSES.index(e.label), e.x0, e.y0, e.x1, e.y1) for e in elements]
    return np.array(rows, float).reshape(-1, 5)


def _pooled_windows(
    seen: Sequence[Element], facade: ColumnsAndFloors, domain: Rectangle, balanced: bool, mirror: bool
) -> Float64Array:
    """Propose a window on every column of every floor, pooled over all grids and extended to the domain."""
    if not len(facade.floors) or not any(e.label == "window" for e in seen):
        return np.zeros((0, 5))
    x0, y0, x1, y1 = domain
    width, height = facade.size.tolist()
    columns = extend_lines(facade.columns.tolist(), width, x0, x1, balanced, False)
    if mirror:
        columns = add_mirror_columns(facade.columns, width, x0 + x1)
        columns = extend_lines(columns.tolist(), width, x0, x1, False, False)
    rows = extend_lines(facade.floors.tolist(), height, y0, y1, False, False)
    nearest = np.abs(rows[:, None] - facade.floors).argmin(axis=1)
    side = facade.floor_size[nearest]
    y, x = np.repeat(rows, len(columns)), np.tile(columns, len(rows))
    half = np.repeat(side, len(columns), axis=0) / 2
    return np.column_stack([np.full(len(x), WINDOW), x - half[:, 0], y - half[:, 1], x + half[:, 0], y + half[:, 1]])


def _window_grid(x: Float64Array, widths: Float64Array, y: Float64Array, heights: Float64Array) -> Float64Array:
    """Propose windows at every column and row, up to the limit of a variant: tiny spacings would give millions."""
    rows = _MAX_VARIANT_GUESSES // max(len(x), 1) + 1
    x, y, widths, heights = x[:_MAX_VARIANT_GUESSES], y[:rows], widths[:rows], heights[:rows]
    x, y, w, h = np.tile(x, len(y)), np.repeat(y, len(x)), np.repeat(widths, len(x)) / 2, np.repeat(heights, len(x)) / 2
    return np.column_stack([np.full(len(x), WINDOW), x - w, y - h, x + w, y + h])


def _floor_windows(
    seen: Sequence[Element], facade: ColumnsAndFloors, domain: Rectangle, how: Float64Array
) -> list[Float64Array]:
    """Propose windows on floors extrapolated by each progression of the database."""
    if len(facade.floors) < 2 or not any(e.label == "window" for e in seen):
        return [_NO_GUESSES] * len(how)
    columns = extend_lines(facade.columns.tolist(), float(facade.size[0]), domain[0], domain[2], True, False)
    found = []
    for way in how:
        rows, heights = extrapolate_floors(facade.floors, facade.floor_size[:, 1], way, domain[1], domain[3]).T
        below = rows > facade.floors[-1]
        widths = np.where(below, facade.floor_size[-1, 0], facade.floor_size[0, 0])
        found.append(_window_grid(columns, widths, rows, heights))
    return found


def _pitch_windows(
    seen: Sequence[Element], facade: ColumnsAndFloors, domain: Rectangle, ratios: Float64Array
) -> list[Float64Array]:
    """Propose rows, then columns, at the smallest observed pitch and at pitches usual for the window size."""
    if not any(e.label == "window" for e in seen):
        return [_NO_GUESSES] * (2 * len(ratios) + 2)
    own = (facade.columns, facade.floors)
    usual = [
        extend_lines(lines.tolist(), size, domain[axis], domain[axis + 2], axis == 0, False)
        for axis, (lines, size) in enumerate(zip(own, facade.size.tolist(), strict=True))
    ]
    found = []
    for axis in (1, 0):
        size = float(facade.size[axis])
        least = float(np.diff(own[axis]).min()) if len(own[axis]) > 1 else size / float(ratios[len(ratios) // 2, axis])
        for pitch in (max(least, 1.05 * size), *(size / ratios[:, axis])):
            lines = list(usual)
            lines[axis] = resample_lines(own[axis], float(pitch), size, domain[axis], domain[axis + 2])
            nearest = np.abs(lines[1][:, None] - facade.floors).argmin(axis=1)
            width, height = facade.floor_size[nearest].T
            found.append(_window_grid(lines[0], width, lines[1], height))
    return found


def _mirror_elements(seen: Sequence[Element], domain: Rectangle) -> Float64Array:
    found = _guess_array(e for e in seen if e.label in ELEMENT_CLASSES)
    found[:, 1:] = _mirror_boxes(found[:, 1:], domain)
    return found


def _ground_elements(
    seen: Sequence[Element],
    facade: ColumnsAndFloors,
    domain: Rectangle,
    label: int,
    sizes: Float64Array,
    at: Sequence[float],
) -> Float64Array:
    """Propose doors or shops on the ground line: mapped, under columns, between columns and in the middle."""
    same = box_array([e for e in seen if e.label == ELEMENT_CLASSES[label]])
    columns = np.array([(domain[0] + domain[2]) / 2])
    if len(facade.columns):
        width = float(facade.size[0])
        carried = extend_lines(facade.columns.tolist(), width, domain[0], domain[2], True, False)
        both = extend_lines(
            add_mirror_columns(facade.columns, width, domain[0] + domain[2]).tolist(),
            width,
            domain[0],
            domain[2],
            False,
            False,
        )
        columns = np.concatenate([carried, (carried[1:] + carried[:-1]) / 2, both, columns])
    columns = np.concatenate([np.array(at, float), columns])
    if len(same):
        size = np.median(same[:, 2:] - same[:, :2], axis=0)
        own = np.array([[*size, max(0.0, facade.ground - float(np.median(same[:, 3])))]])
    else:
        own = sizes * np.array([facade.size[0], facade.size[1], facade.size[1]])
    x = np.repeat(columns, len(own))
    w, h, gap = np.tile(own, (len(columns), 1)).T
    if label == SHOP and len(facade.columns) > 1:
        # Also shops as wide as one or two columns less a pier.
        pitch, (_, tall, low) = float(np.median(np.diff(facade.columns))), np.median(own, axis=0)
        for wide in (pitch - _PIER_SHARE * facade.size[0], 2 * pitch - _PIER_SHARE * facade.size[0]):
            x, w = np.append(x, columns), np.append(w, np.full(len(columns), wide))
            h, gap = np.append(h, np.full(len(columns), tall)), np.append(gap, np.full(len(columns), low))
    foot = facade.ground - gap
    return np.column_stack([np.full(len(x), label), x - w / 2, foot - h, x + w / 2, foot])


def _stretch_grids(seen: Sequence[Element], fitted: Sequence[Grid], domain: Rectangle) -> Float64Array:
    """Propose every grid on the columns of all windows and on its own floors."""
    facade = fit_columns_and_floors(seen, domain)
    found = []
    for grid in fitted:
        label = ELEMENT_CLASSES.index(grid.label) if grid.label in ELEMENT_CLASSES else -1
        if label < 0 or not len(facade.columns):
            continue
        columns = extend_lines(facade.columns.tolist(), grid.width, domain[0], domain[2], True, False)
        y, x = np.repeat(grid.rows, len(columns)), np.tile(columns, len(grid.rows))
        w, h = grid.width / 2, grid.height / 2
        found.append(np.column_stack([np.full(len(x), label), x - w, y - h, x + w, y + h]))
    return np.concatenate(found) if found else np.zeros((0, 5))


def _stack_balconies(seen: Sequence[Element], facade: ColumnsAndFloors, domain: Rectangle) -> Float64Array:
    """Propose every balcony and its mirror image on every other floor, at the same height above it."""
    box = box_array([e for e in seen if e.label == "balcony"])
    if not len(box) or not len(facade.floors):
        return np.zeros((0, 5))
    box = np.concatenate([box, _mirror_boxes(box, domain)])
    floors = extend_lines(facade.floors.tolist(), float(facade.size[1]), domain[1], domain[3], False, False)
    own = np.abs((box[:, 1] + box[:, 3])[:, None] / 2 - floors).argmin(axis=1)
    shift = (floors - floors[own][:, None]).ravel()
    found = np.repeat(box, len(floors), axis=0)
    found[:, [1, 3]] += shift[:, None]
    return np.column_stack([np.full(len(found), BALCONY), found])


def _mirror_boxes(box: Float64Array, domain: Rectangle) -> Float64Array:
    out = box.copy()
    out[:, [0, 2]] = domain[0] + domain[2] - box[:, [2, 0]]
    return out


def move_clear(box: Float64Array, domain: Rectangle, region: Float64Array) -> tuple[Float64Array, BoolArray]:
    """Move rectangles out of the visible region and into the domain by little; return them and those that are clear."""
    box = box.copy()
    side = box[:, 2:] - box[:, :2]
    for r in region:
        inward = np.stack([box[:, 2] - r[0], r[2] - box[:, 0], box[:, 3] - r[1], r[3] - box[:, 1]], axis=1)
        share = inward / side[:, [0, 0, 1, 1]]
        way = share.argmin(axis=1)
        least = share[np.arange(len(box)), way]
        for k, (axis, sign) in enumerate(((0, -1), (0, 1), (1, -1), (1, 1))):
            moved = (way == k) & (least > 0) & (least < _MAX_SHIFT_SHARE)
            if moved.any():
                edge = r[axis] if sign < 0 else r[axis + 2]
                box[moved, axis] = edge - side[moved, axis] if sign < 0 else edge
                box[moved, axis + 2] = edge if sign < 0 else edge + side[moved, axis]
    low, high = np.array(domain[:2]), np.array(domain[2:])
    for step in (
        np.clip(low - box[:, :2], 0, _MAX_SHIFT_SHARE * side),
        -np.clip(box[:, 2:] - high, 0, _MAX_SHIFT_SHARE * side),
    ):
        box[:, :2] += step
        box[:, 2:] += step
    slack = 1e-6 * (high - low)
    inside = (box[:, :2] >= low - slack).all(axis=1) & (box[:, 2:] <= high + slack).all(axis=1)
    box[:, :2], box[:, 2:] = np.maximum(box[:, :2], low), np.minimum(box[:, 2:], high)
    if len(region):
        inside &= ~overlap_mask(box, region).any(axis=1)
    return box, inside & (box[:, 2:] > box[:, :2]).all(axis=1)


def avoids_observed(raw: Float64Array, seen: Sequence[Element]) -> BoolArray:
    other = np.array([ELEMENT_CLASSES.index(e.label) if e.label in ELEMENT_CLASSES else -1 for e in seen], int)
    conflicts = overlap_mask(raw[:, 1:], box_array(seen)) & ~labels_may_overlap(raw[:, 0], other)
    is_free: BoolArray = ~np.any(conflicts, axis=1)
    return is_free


def _unique_guesses(raw: Float64Array) -> Int64Array:
    """Return indices of guesses that represent all others: each guess is similar to one of them."""
    found: list[Int64Array] = []
    for label in np.unique(raw[:, 0]):
        index = np.flatnonzero(raw[:, 0] == label)
        step = 0.02 * (raw[index, 3:] - raw[index, 1:3]).min(axis=0)[[0, 1, 0, 1]]
        _, first, count = np.unique(np.round(raw[index, 1:] / step), axis=0, return_index=True, return_counts=True)
        order = np.lexsort((first, -count))
        index = index[first[order]]
        found.append(index[select_distinct_rectangles(raw[index, 1:])])
    return np.concatenate(found) if found else np.zeros(0, int)
