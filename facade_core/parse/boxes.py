"""From a label map to a list of clean rectangles."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import ndimage

from facade_core.labels import CLASSES, ELEMENT_CLASSES
from facade_core.parse.checks import check_labels
from facade_core.types import Element, Parsing

# A component smaller than this share of the image is noise: about 7 x 7 pixels in a facade of 500 x 330.
_LEAST_SHARE = 0.0003
# A row or column belongs to the box when it holds this share of the fullest one.
_EDGE = 0.4
# A dip in the profile parts two elements when it is below this share of the peaks on both sides.
_DIP = 0.35

_Box = tuple[int, int, int, int]


def elements(parsing: Parsing | np.ndarray) -> list[Element]:
    """Windows, balconies, doors and shops as rectangles in pixels, half-open, by y0, then x0.

    Takes a Parsing or its (H, W) uint8 labels. Each 4-connected component becomes one box, or several where a row or
    column profile dips between two peaks; the box spans the rows and columns that are well filled, so that single
    protruding pixels do not count. Components below 0.03 % of the image are dropped, as are boxes more than half
    occluded: what is hidden is not an observation. Raises ImageError for a label map that cannot be used.
    """
    labels = parsing.labels if isinstance(parsing, Parsing) else parsing
    check_labels(labels)
    least = max(1.0, _LEAST_SHARE * labels.size)
    found = [
        Element(name, float(x0), float(y0), float(x1), float(y1))
        for name in ELEMENT_CLASSES
        for y0, x0, y1, x1 in _class_boxes(labels == CLASSES.index(name), least)
        if not (isinstance(parsing, Parsing) and parsing.occluded[y0:y1, x0:x1].mean() > 0.5)
    ]
    return sorted(found, key=lambda element: (element.y0, element.x0, element.y1, element.x1, element.label))


def _class_boxes(mask: np.ndarray, least: float) -> Iterator[_Box]:
    components, _ = ndimage.label(mask)
    sizes = np.bincount(components.reshape(-1))
    places = ndimage.find_objects(components)
    for number in np.flatnonzero(sizes[1:] >= least) + 1:
        rows, columns = places[number - 1]
        component = components[rows, columns] == number
        for y0, x0, y1, x1 in _split(component, least):
            yield y0 + rows.start, x0 + columns.start, y1 + rows.start, x1 + columns.start


def _split(component: np.ndarray, least: float) -> list[_Box]:
    """Boxes of a component: trimmed to its well-filled part, cut at the clearest dip, and so on in both parts."""
    if np.count_nonzero(component) < least:
        return []
    y0, x0, y1, x1 = _trim(component)
    inner = component[y0:y1, x0:x1]
    (row_dip, row), (column_dip, column) = _dip(inner.sum(1)), _dip(inner.sum(0))
    if min(row_dip, column_dip) >= _DIP:
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


def _trim(component: np.ndarray) -> _Box:
    """The span of the well-filled rows and columns, across the long side first: it has the steadier profile."""
    y0, x0, (y1, x1) = 0, 0, component.shape
    if x1 >= y1:
        y0, y1 = _span(component.sum(1))
        x0, x1 = _span(component[y0:y1].sum(0))
    else:
        x0, x1 = _span(component.sum(0))
        y0, y1 = _span(component[:, x0:x1].sum(1))
    return y0, x0, y1, x1


def _span(profile: np.ndarray) -> tuple[int, int]:
    full = np.flatnonzero(profile >= _EDGE * profile.max())
    return int(full[0]), int(full[-1]) + 1


def _dip(profile: np.ndarray) -> tuple[float, int]:
    """The deepest dip: its share of the lower of the peaks beside it, and the middle of its lowest stretch."""
    if len(profile) < 3:
        return 1.0, 0
    left, right = np.maximum.accumulate(profile), np.maximum.accumulate(profile[::-1])[::-1]
    peaks = np.minimum(left, right)
    share = np.divide(profile, peaks, out=np.ones(len(profile)), where=peaks > 0)  # an empty end is no dip
    lowest = np.flatnonzero(share == share.min())
    return float(share.min()), int(lowest[len(lowest) // 2])
