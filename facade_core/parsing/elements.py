"""Elements of a label map as clean rectangles."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator, Sequence

import numpy as np
from scipy import ndimage

from facade_core.core.arrays import BoolArray, Int64Array, UInt8Array
from facade_core.core.labels import CLASSES, ELEMENT_CLASSES, FacadeClass
from facade_core.core.types import Element, Parsing
from facade_core.parsing.validation import check_labels

# Smaller components, as a share of the image, are noise: about 7 x 7 pixels in a facade of 500 x 330.
_MIN_COMPONENT_SHARE = 0.0003
# Boxes below this share of their class's median area are slivers: a fanlight, a corner of a sign.
_MIN_MEDIAN_RATIO = 0.2
# A row or column belongs to the box if it has this share of the fullest one.
_MIN_FILL_RATIO = 0.4
# Two balconies that have merged are lower between their windows than this share of the height in front of them.
_NECK_RATIO = 0.7
# A balcony belongs to windows whose foot is above its top, or below by less than this share of the window's
# height.
_MAX_FOOT_GAP = 0.3
# A dip in the profile splits an element if it is below this share of the peaks on both sides.
_SPLIT_RATIO = 0.35

_Box = tuple[int, int, int, int]


def elements(parsing: Parsing | UInt8Array) -> list[Element]:
    """Extract windows, balconies, doors and shops as rectangles in pixels, half-open, by y0, then x0.

    Each 4-connected component becomes one box, or several where a row or column profile dips between two peaks. The box
    spans the well-filled rows and columns, so that single protruding pixels do not count. A balcony is also cut between
    two windows if it is lower there than in front of them. Dropped are components below 0.03 % of the image, boxes
    below a fifth of their class's median area, and boxes more than half occluded, which are no observation. The
    confidence of an element is the mean of its class's over its box.

    Parameters
    ----------
    parsing : a Parsing, or its (H, W) uint8 labels.

    Raises
    ------
    ImageError
        If the label map cannot be used.
    """
    labels = parsing.labels if isinstance(parsing, Parsing) else parsing
    check_labels(labels)
    least = max(1.0, _MIN_COMPONENT_SHARE * labels.size)
    boxes = {name: list(_class_boxes(labels == CLASSES.index(name), least)) for name in ELEMENT_CLASSES}
    boxes = {name: _drop_slivers(same) for name, same in boxes.items()}
    boxes["balcony"] = [
        part for box in boxes["balcony"] for part in _cut_balcony(box, boxes["window"], labels == FacadeClass.BALCONY)
    ]
    found_elements = []
    for name, (y0, x0, y1, x1) in ((name, box) for name, same in boxes.items() for box in same):
        confidence = 1.0
        if isinstance(parsing, Parsing):
            if parsing.occluded[y0:y1, x0:x1].mean() > 0.5:
                continue
            confidence = float(parsing.confidence[y0:y1, x0:x1, CLASSES.index(name)].mean())
        found_elements.append(Element(name, float(x0), float(y0), float(x1), float(y1), confidence))
    return sorted(found_elements, key=lambda element: (element.y0, element.x0, element.y1, element.x1, element.label))


def _drop_slivers(boxes: Sequence[_Box]) -> list[_Box]:
    areas = [(y1 - y0) * (x1 - x0) for y0, x0, y1, x1 in boxes]
    least = _MIN_MEDIAN_RATIO * np.median(areas) if areas else 0
    return [box for box, area in zip(boxes, areas, strict=True) if area >= least]


def split_balconies(layout: Sequence[Element]) -> list[Element]:
    """Split balconies that serve several windows midway between these; other elements and the order stay."""
    windows = [(int(e.y0), int(e.x0), int(e.y1), int(e.x1)) for e in layout if e.label == "window"]
    parted = []
    for element in layout:
        edges = [element.x0, element.x1]
        if element.label == "balcony":
            balcony_windows = _balcony_windows(
                (int(element.y0), int(element.x0), int(element.y1), int(element.x1)), windows
            )
            edges[1:1] = [(window[3] + other[1]) / 2 for window, other in itertools.pairwise(balcony_windows)]
        parted += [dataclasses.replace(element, x0=x0, x1=x1) for x0, x1 in itertools.pairwise(edges)]
    return parted


def _balcony_windows(balcony: _Box, windows: Sequence[_Box]) -> list[_Box]:
    """Windows behind a balcony, from left to right: it covers their middle column and reaches their foot."""
    y0, x0, y1, x1 = balcony
    served = [
        (top, left, bottom, right)
        for top, left, bottom, right in windows
        if x0 < (left + right) / 2 < x1 and (top + bottom) / 2 < y1 and y0 < bottom + _MAX_FOOT_GAP * (bottom - top)
    ]
    return sorted(served, key=lambda box: box[1])


def _cut_balcony(balcony: _Box, windows: Sequence[_Box], mask: BoolArray) -> list[_Box]:
    """Balcony cut between its windows where its profile is lower than in front of both."""
    y0, x0, y1, x1 = balcony
    profile = mask[y0:y1, x0:x1].sum(0)
    edges = [x0]
    for window, other in itertools.pairwise(_balcony_windows(balcony, windows)):
        gap, sides = slice(window[3], other[1]), (slice(window[1], window[3]), slice(other[1], other[3]))
        between = profile[max(0, gap.start - x0) : gap.stop - x0]
        least = min(np.median(profile[max(0, side.start - x0) : side.stop - x0]) for side in sides)
        if len(between) and between.min() < _NECK_RATIO * least:
            lowest = np.flatnonzero(between == between.min())
            edges.append(max(x0, gap.start) + int(lowest[len(lowest) // 2]))
    return [(y0, left, y1, right) for left, right in itertools.pairwise([*edges, x1])]


def _class_boxes(mask: BoolArray, least: float) -> Iterator[_Box]:
    components, _ = ndimage.label(mask)
    sizes = np.bincount(components.reshape(-1))
    places = ndimage.find_objects(components)
    for number in np.flatnonzero(sizes[1:] >= least) + 1:
        rows, columns = places[number - 1]
        component = components[rows, columns] == number
        for y0, x0, y1, x1 in _split(component, least):
            yield y0 + rows.start, x0 + columns.start, y1 + rows.start, x1 + columns.start


def _split(component: BoolArray, least: float) -> list[_Box]:
    """Boxes of a component: trimmed to its well-filled part, cut at the clearest dip, and recursively split."""
    if np.count_nonzero(component) < least:
        return []
    y0, x0, y1, x1 = _trim(component)
    inner = component[y0:y1, x0:x1]
    (row_dip, row), (column_dip, column) = _dip(inner.sum(1)), _dip(inner.sum(0))
    if min(row_dip, column_dip) >= _SPLIT_RATIO:
        return [(y0, x0, y1, x1)]
    if row_dip < column_dip:
        parts = [(inner[:row], 0, 0), (inner[row:], row, 0)]
    else:
        parts = [(inner[:, :column], 0, 0), (inner[:, column:], 0, column)]
    return [
        (y0 + dy + top, x0 + dx + left, y0 + dy + bottom, x0 + dx + right)
        for part, dy, dx in parts
        for top, left, bottom, right in _split(part, least)
    ]


def _trim(component: BoolArray) -> _Box:
    """Span of the well-filled rows and columns, across the long side first, which has the steadier profile."""
    y0, x0, (y1, x1) = 0, 0, component.shape
    if x1 >= y1:
        y0, y1 = _span(component.sum(1))
        x0, x1 = _span(component[y0:y1].sum(0))
    else:
        x0, x1 = _span(component.sum(0))
        y0, y1 = _span(component[:, x0:x1].sum(1))
    return y0, x0, y1, x1


def _span(profile: Int64Array) -> tuple[int, int]:
    full = np.flatnonzero(profile >= _MIN_FILL_RATIO * profile.max())
    return int(full[0]), int(full[-1]) + 1


def _dip(profile: Int64Array) -> tuple[float, int]:
    """Deepest dip: its share of the lower neighbouring peak, and the middle of its lowest stretch."""
    if len(profile) < 3:
        return 1.0, 0
    left, right = np.maximum.accumulate(profile), np.maximum.accumulate(profile[::-1])[::-1]
    peaks = np.minimum(left, right)
    share = np.divide(profile, peaks, out=np.ones(len(profile)), where=peaks > 0)  # an empty end is no dip
    lowest = np.flatnonzero(share == share.min())
    return float(share.min()), int(lowest[len(lowest) // 2])
