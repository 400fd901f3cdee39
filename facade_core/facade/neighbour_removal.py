"""Neighbours beside a rectified facade that the crop of the photo has left in the picture."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import cv2
import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.core.resizing import resize_image
from facade_core.imagery.rectify.neighbours import WORKING_ROWS, measure_gaps, party_wall_log_odds
from facade_core.parsing.floor_structure import find_floors_and_bays, spans_above_threshold

# Share of the rows of a column outside the facade from which the column parts two houses.
MIN_OUTSIDE_SHARE = 0.5
# Log-odds of a party wall for each unit of CIELAB by which the colours of the wall differ; lightness counts by half, as shade
# changes it.
COLOUR_WEIGHT = 0.8
LIGHTNESS_WEIGHT = 0.5
# Width of the strips of wall that are compared, as a share of the height, and the pixels that a strip needs.
STRIP_SHARE = 0.2
MIN_STRIP_PIXELS = 20
# Log-odds of a party wall from which all beyond it is cut off, and from which a single bay at a side is.
MIN_LOG_ODDS = 0.0
MIN_END_LOG_ODDS = -2.0
# Half floors in which both strips show wall, and the share of them that may differ less.
MIN_BANDS = 3
BAND_QUANTILE = 0.2
# Change of colour that shows a neighbour's strip at a side, which is too narrow for its rows to be compared; its widths, as
# shares of the height and of the width; columns between those at which it is looked for, and windows in them.
MIN_SIDE_CHANGE = 6.0
MIN_SIDE_SHARE = 0.02
MAX_SIDE_SHARE = 0.25
SIDE_STEP_PX = 3
MAX_WINDOW_SHARE = 0.04
# Difference in CIELAB from the wall of the same row at which a pixel beside the outer windows shows something else, the share
# of such pixels of a column that shows some, beyond that beside inner windows, columns between it and the side, and the
# largest share of the width that is cut off: more is a part of the facade.
MIN_FOREIGN_DIFFERENCE = 25.0
MIN_FOREIGN_SHARE = 0.04
MAX_SIDE_GAP_PX = 3
MAX_FOREIGN_WIDTH = 0.1
# Width of the strip at one side, relative to that at the other, from which both are ornament, such as quoins.
MIN_SIDE_LIKENESS = 0.7
# Bays that remain of a facade.
MIN_BAYS = 2


def find_own_columns(image: UInt8Array, labels: UInt8Array, hidden: BoolArray, outside: BoolArray) -> tuple[int, int]:
    """Find the columns of the widest house of MIN_BAYS bays or more in a rectified picture.

    An exemplar loses little by a bay that was cut off, and shows two houses with a neighbour's. So every gap between windows
    counts as a party wall that more probably is one than not, by the rows of ledges and windows (`measure_gaps`) and by the
    colour of the wall on both sides, which differs on all floors. A narrow strip at a side is known by its colour alone. The
    whole picture is returned where no house has as many bays.

    Parameters
    ----------
    image : (h, w, 3) uint8.
    labels : (h, w) uint8 class ids, without sky.
    hidden : (h, w) bool, pixels that do not show the facade.
    outside : (h, w) bool, sky, street or neighbours by the parser.

    Returns
    -------
    First column, and the one after the last.
    """
    height, width = labels.shape
    factor = min(1.0, WORKING_ROWS / height)
    size = max(8, round(height * factor)), max(8, round(width * factor))
    small = resize_image(image, size)
    classes = np.asarray(cv2.resize(labels, size[::-1], interpolation=cv2.INTER_NEAREST), np.uint8)
    unknown = cv2.resize((hidden | outside).astype(np.uint8), size[::-1], interpolation=cv2.INTER_NEAREST) > 0
    found = find_floors_and_bays(classes)
    if found is None:
        return 0, width
    lab = np.asarray(cv2.cvtColor(small.astype(np.float32) / 255, cv2.COLOR_RGB2LAB), np.float32)
    lab *= np.array([LIGHTNESS_WEIGHT, 1, 1], np.float32)
    wall = (classes == FacadeClass.WALL) & ~unknown
    is_parted = outside.mean(axis=0) >= MIN_OUTSIDE_SHARE
    gaps = measure_gaps(small, classes, unknown)
    for number, gap in enumerate(gaps):
        change = measure_colour_change(lab, wall, gap.column, found.floor_cuts)
        least = MIN_END_LOG_ODDS if number in (0, len(gaps) - 1) else MIN_LOG_ODDS
        if party_wall_log_odds(gap.features) + COLOUR_WEIGHT * change > least:
            is_parted[min(width - 1, round(gap.column * width / size[1]))] = True
    is_bare = (classes == FacadeClass.WINDOW).mean(axis=0) <= MAX_WINDOW_SHARE
    for column in _find_side_strips(lab, wall, is_bare, found.floor_cuts):
        is_parted[min(width - 1, round(column * width / size[1]))] = True
    cuts = [-1, *np.flatnonzero(is_parted).tolist(), width]
    bays = [(a + b) / 2 * width / size[1] for a, b in found.bays]
    houses = [
        (left + 1, right)
        for left, right in zip(cuts[:-1], cuts[1:], strict=True)
        if sum(left < bay < right for bay in bays) >= MIN_BAYS
    ]
    return max(houses, key=lambda house: house[1] - house[0], default=(0, width))


def _find_side_strips(lab: Float32Array, wall: BoolArray, is_bare: BoolArray, floor_cuts: tuple[int, ...]) -> list[int]:
    """Find the inner columns of strips of other colour at the sides, one a side at most."""
    height, width = wall.shape
    depths = range(round(MIN_SIDE_SHARE * height), round(MAX_SIDE_SHARE * min(width, height)), SIDE_STEP_PX)
    found = []
    for columns in (depths, [width - 1 - depth for depth in depths]):
        changes = [measure_colour_change(lab, wall, one, floor_cuts) if is_bare[one] else 0.0 for one in columns]
        if changes and max(changes) >= MIN_SIDE_CHANGE:
            found.append(columns[int(np.argmax(changes))])
    return found


def find_clean_columns(image: UInt8Array, labels: UInt8Array) -> tuple[int, int]:
    """Find the columns between things at the sides of an exemplar, before the wall beside its outer windows.

    Every wall from it would repeat half a lamp, or the edge of a neighbour's roof. What inner windows have beside them too,
    such as shutters, belongs to the facade, as do quoins on both sides.

    Parameters
    ----------
    image : (h, w, 3) uint8.
    labels : (h, w) uint8 class ids, without sky.

    Returns
    -------
    First column, and the one after the last.
    """
    found, width = find_floors_and_bays(labels), labels.shape[1]
    if found is None:
        return 0, width
    rows = slice(found.floor_cuts[sum(kind == "roof" for kind in found.kinds)], found.ground_top)
    lab, classes = cv2.cvtColor(image[rows].astype(np.float32) / 255, cv2.COLOR_RGB2LAB), labels[rows]
    left, right = found.bays[0][0], found.bays[-1][1]
    is_wall = (classes == FacadeClass.WALL) & (np.arange(width) >= left) & (np.arange(width) < right)
    walled = np.flatnonzero(is_wall.any(axis=1))
    if not len(walled):
        return 0, width
    usual = np.array([np.median(lab[row][is_wall[row]], axis=0) for row in walled.tolist()])
    is_foreign = np.linalg.norm(lab[walled] - usual[:, None], axis=2) > MIN_FOREIGN_DIFFERENCE
    share = (is_foreign & np.isin(classes[walled], (FacadeClass.WALL, FacadeClass.ROOF))).mean(axis=0)
    beside = []
    for (_, end), (start, _) in pairwise(found.bays):
        beside += [share[end : (end + start) // 2], share[(end + start) // 2 : start][::-1]]
    sides = [_count_foreign_columns(one, beside) for one in (share[:left][::-1], share[right:])]
    first, last = (count if count <= MAX_FOREIGN_WIDTH * width else 0 for count in sides)
    if min(first, last) >= MIN_SIDE_LIKENESS * max(first, last):
        return 0, width
    return first, width - last


def _count_foreign_columns(outward: Float64Array, beside: Sequence[Float64Array]) -> int:
    """Count the foreign columns at a side, given the foreign shares outward from the outer window and from inner ones."""
    is_foreign = np.zeros(len(outward), bool)
    for distance, share in enumerate(outward.tolist()):
        usual = [float(one[distance]) for one in beside if len(one) > distance] or [0.0]
        is_foreign[-1 - distance] = share > np.median(usual) + MIN_FOREIGN_SHARE
    for start, end in spans_above_threshold(is_foreign.astype(np.float64), 0.5):
        return end if start < MAX_SIDE_GAP_PX and end < len(is_foreign) else 0
    return 0


def measure_colour_change(lab: Float32Array, wall: BoolArray, column: int, floor_cuts: tuple[int, ...]) -> float:
    """Measure by how much the wall's colour changes at a column on nearly all floors.

    Parameters
    ----------
    lab : (h, w, 3) float32 colour.
    wall : (h, w) bool, pixels of visible wall.
    column : column between windows.
    floor_cuts : borders of the floors.

    Returns
    -------
    Change along the median change of all half floors that a share of 1 - BAND_QUANTILE exceeds; at least 0.
    """
    reach = round(STRIP_SHARE * len(wall))
    sides = slice(max(0, column - reach), column), slice(column, column + reach)
    changes = []
    for top, bottom in zip(floor_cuts[:-1], floor_cuts[1:], strict=True):
        for rows in (slice(top, (top + bottom) // 2), slice((top + bottom) // 2, bottom)):
            left, right = (lab[rows, side][wall[rows, side]] for side in sides)
            if min(len(left), len(right)) >= MIN_STRIP_PIXELS:
                changes.append(np.median(right, axis=0) - np.median(left, axis=0))
    if len(changes) < MIN_BANDS:
        return 0.0
    median = np.median(changes, axis=0)
    length = float(np.sqrt((median**2).sum()))
    along = (np.array(changes) * (median / max(length, 1e-6))).sum(axis=1)
    return max(0.0, float(np.quantile(along, BAND_QUANTILE)))
