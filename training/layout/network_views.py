"""Training views of the layout network: layouts changed at random, with a part hidden."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from facade_core.core.arrays import Float32Array, Float64Array, Int64Array
from facade_core.core.labels import ELEMENT_CLASSES
from facade_core.core.types import Element
from facade_core.facade.layout.facade_frame import Rectangle
from facade_core.facade.layout.grids import box_array
from facade_core.facade.layout.network.raster import RASTER, draw_region, fit_pixel_scale
from training.layout import cases as training_cases

if TYPE_CHECKING:
    from training.layout.ranking_examples import Layout

# Most elements of a view.
MAX_ELEMENTS = 256
# Shares of views: of the benchmark's kinds, of regular facades.
_BENCHMARK_SHARE = 0.6
_REGULAR_SHARE = 0.06
# Share of views whose floors or columns are cut out or repeated.
_CUT_SHARE = 0.5
# Spread of the logarithm of a view's scale, and of the sizes of all its windows.
_SCALE_SPREAD = 0.08
_SIZE_SPREAD = 0.08
# Facades of fewer elements are not cut further.
_MIN_ELEMENTS = 6


@dataclass(frozen=True, slots=True, eq=False)
class LayoutView:
    """Layout with a part hidden, in pixels of the raster.

    Attributes
    ----------
    box : (N, 4) all elements.
    label : (N,) index into ELEMENT_CLASSES.
    hidden : (N,) one of a hidden element, else zero.
    distance : (N,) distance of an element from the visible region.
    extent : (2,) width and height of the domain.
    region : (2, rows, columns) visible shares of the pixels, and those of the mirror image.
    """

    box: Float32Array
    label: Int64Array
    hidden: Float32Array
    distance: Float32Array
    extent: Float32Array
    region: Float32Array


def sample_layout_view(
    layouts: Sequence[Layout], generated: Sequence[Layout], generated_share: float, rng: np.random.Generator
) -> LayoutView | None:
    """Sample one view; None where nothing, or nothing else, is hidden.

    Parameters
    ----------
    layouts : layouts of the database.
    generated : painter's plans.
    generated_share : share of views of `generated`.
    rng : source of randomness.
    """
    draw = rng.uniform()
    elements: Sequence[Element]
    if draw < _REGULAR_SHARE:
        elements, domain = training_cases.sample_regular_layout(rng)
    elif draw < _REGULAR_SHARE + generated_share and generated:
        elements, domain = generated[int(rng.integers(len(generated)))]
    else:
        elements, domain = layouts[int(rng.integers(len(layouts)))]
    label = np.array([ELEMENT_CLASSES.index(e.label) for e in elements])
    box = box_array(elements)
    box, label, domain = _change_layout(box, label, domain, rng)
    if not 2 <= len(box) <= MAX_ELEMENTS:
        return None
    changed = [Element(ELEMENT_CLASSES[k], *sides) for k, sides in zip(label.tolist(), box.tolist(), strict=True)]
    common = rng.uniform() < _BENCHMARK_SHARE
    kinds = training_cases.CASE_KINDS if common else training_cases.OTHER_KINDS
    seen, region = training_cases.hide_part(kinds[int(rng.integers(len(kinds)))], changed, domain, rng)
    if not seen or len(seen) == len(changed):
        return None
    shown = set(seen)
    hidden = np.array([e not in shown for e in changed])
    if not hidden.any():
        return None
    scale = fit_pixel_scale(seen, domain)
    factor = np.exp(rng.normal(0, _SCALE_SPREAD, 2))
    extent = np.array([domain[2] - domain[0], domain[3] - domain[1]])
    scale = np.minimum(scale * factor, np.array(RASTER[::-1]) / extent)
    to_pixels, origin = np.tile(scale, 2), np.tile(domain[:2], 2)
    boxes = (np.array(region, float).reshape(-1, 4) - origin) * to_pixels
    box = (box - origin) * to_pixels
    return LayoutView(
        box.astype(np.float32),
        label,
        hidden.astype(np.float32),
        _box_distance(box, boxes).astype(np.float32),
        (extent * scale).astype(np.float32),
        draw_region(boxes, float(extent[0] * scale[0])),
    )


def _change_layout(
    box: Float64Array, label: Int64Array, domain: Rectangle, rng: np.random.Generator
) -> tuple[Float64Array, Int64Array, Rectangle]:
    """Mirror a layout, cut out or repeat floors and columns, and change the size of its windows, at random."""
    low, high = np.array(domain[:2]), np.array(domain[2:])
    if rng.uniform() < 0.5:
        box = box.copy()
        box[:, [0, 2]] = low[0] + high[0] - box[:, [2, 0]]
    for axis in (0, 1):
        if rng.uniform() < _CUT_SHARE:
            box, label, high[axis] = _cut_or_repeat(box, label, float(low[axis]), float(high[axis]), axis, rng)
    if rng.uniform() < 0.5:
        factor = np.exp(rng.normal(0, _SIZE_SPREAD, 2)).clip(0.75, 1.2)
        window = label == 0
        middle, half = (
            (box[:, :2] + box[:, 2:]) / 2,
            (box[:, 2:] - box[:, :2]) / 2 * np.where(window[:, None], factor, 1),
        )
        box = np.concatenate([middle - half, middle + half], axis=1)
    return box, label, (float(low[0]), float(low[1]), float(high[0]), float(high[1]))


def _cut_or_repeat(
    box: Float64Array, label: Int64Array, low: float, high: float, axis: int, rng: np.random.Generator
) -> tuple[Float64Array, Int64Array, float]:
    """Cut out, or repeat, the part between two lines that cross no element; return the domain's new end too."""
    order = np.argsort(box[:, axis])
    ends = np.maximum.accumulate(box[order, axis + 2])
    starts = np.append(box[order, axis][1:], high)
    free = ends < starts
    lines = np.append(low, (ends[free] + starts[free]) / 2)
    lines = lines[(lines >= low) & (lines < high)]
    if len(lines) < 3:
        return box, label, high
    a, b = np.sort(rng.choice(lines, 2, replace=False)).tolist()
    middle = (box[:, axis] + box[:, axis + 2]) / 2
    inside, length = (middle > a) & (middle < b), b - a
    moved = box.copy()
    if rng.uniform() < 0.5 and length < 0.6 * (high - low) and len(box) + inside.sum() <= MAX_ELEMENTS:
        moved[middle > b] += _shift(axis, length)
        return (
            np.concatenate([moved, box[inside] + _shift(axis, length)]),
            np.append(label, label[inside]),
            high + length,
        )
    if (~inside).sum() < _MIN_ELEMENTS or length > 0.6 * (high - low):
        return box, label, high
    moved[middle > b] -= _shift(axis, length)
    return moved[~inside], label[~inside], high - length


def _shift(axis: int, length: float) -> Float64Array:
    shift: Float64Array = np.tile(length * (np.arange(2) == axis), 2)
    return shift


def _box_distance(box: Float64Array, region: Float64Array) -> Float64Array:
    """Return the (N,) distance of each box's centre to the nearest of (M, 4) boxes."""
    middle = (box[:, None, :2] + box[:, None, 2:]) / 2
    away = np.maximum(region[:, :2] - middle, middle - region[:, 2:]).clip(0)
    nearest: Float64Array = np.hypot(away[..., 0], away[..., 1]).min(axis=1)
    return nearest
