"""Party walls between the facade of a rectified photo and its neighbours.

Windows leave gaps of bare columns between them. A gap is a party wall if what is left of it continues badly on its right:
other rows of ledges and windows; and if a line runs down it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d, uniform_filter1d

from facade_core.core.arrays import AnyArray, BoolArray, Float64Array, UInt8Array
from facade_core.core.fixed_order import multiply_matrices
from facade_core.core.labels import FacadeClass

# Rows at which pictures are compared, and most columns: of wider ones the columns are compared coarser.
WORKING_ROWS = 480
MAX_WORKING_COLUMNS = 2400
# Columns of a gap have windows in at most this share of their rows.
MAX_WINDOW_SHARE = 0.04
# Widest strip on each side of a gap that is compared, as a share of the height.
STRIP_SHARE = 0.3
# Strips narrower than this share of the height are too narrow to compare.
MIN_STRIP_SHARE = 0.07
# Rows by which ledges may be off, as a share of the height.
LEDGE_BLUR_SHARE = 0.004
# Rows of which less is known are not compared.
MIN_KNOWN_SHARE = 0.3
# Weight of a line down a gap against the rows of ledges, where the party wall is in the gap.
LINE_WEIGHT = 0.3
# Columns of a facade have edges in at most this share of their rows; trees and scaffolds have more, which look like lines.
MAX_EDGE_SHARE = 0.6
# Change of the logarithm of the brightness that counts as an edge.
EDGE_STEP = 0.06
# Logistic regression of GapEvidence.features, over painted pairs of held-in facades; the constant was fitted to street photos.
WEIGHTS = np.array([6.0, 2.0, 20.0, 12.0])
BIAS = -20.0
# Facades narrower than this share of their height are none.
MIN_FACADE_ASPECT = 0.25
# Columns farther from the photo's middle than this share of its width count nothing.
MAX_CENTRE_DISTANCE = 0.75
# The photo's middle is on its facade, or at most this share of the height beside it.
MAX_AIM_ERROR = 0.05
# Smallest share of a crop that the photo shows.
MIN_SEEN_SHARE = 0.5
# Weight of the share that a facade has of the columns around the photo's middle.
CENTRE_WEIGHT = 1.5
# Standard deviation of the logarithm of width over height.
ASPECT_SIGMA = 0.2


class GapEvidence(NamedTuple):
    """Evidence that columns between windows are a party wall.

    Attributes
    ----------
    column : x in pixels of the picture.
    features : (4,) mismatch of ledges and of windows, line down the gap, bare width.
    """

    column: int
    features: Float64Array


def measure_gaps(image: UInt8Array, labels: UInt8Array, unknown: BoolArray) -> list[GapEvidence]:
    """Measure the evidence of every gap between the windows of a rectified picture.

    Parameters
    ----------
    image : (h, w, 3) uint8.
    labels : (h, w) uint8 classes.
    unknown : (h, w) bool, pixels that show no facade: hidden, or outside it.
    """
    import cv2

    height, width = labels.shape
    columns = max(1, round(width * WORKING_ROWS / height))
    squeeze = min(1.0, MAX_WORKING_COLUMNS / columns)  # memory would grow with the square of width over height
    unit = WORKING_ROWS * squeeze  # columns as wide as the picture is high
    size = (round(columns * squeeze), WORKING_ROWS)
    scale = WORKING_ROWS / height * squeeze
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    classes = cv2.resize(labels, size, interpolation=cv2.INTER_NEAREST)
    known = cv2.resize(unknown.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) == 0
    bright = sum(np.log(small[..., band] + 12.0) for band in range(3)) / 3  # one band in float64 at a time
    window = (classes == FacadeClass.WINDOW) & known
    ledges = np.where(known, cv2.Sobel(bright, -1, 0, 1, ksize=3) / 4, 0.0)
    ledges = np.clip(ledges, -0.5, 0.5)
    upright = np.where(known & ~window, np.abs(cv2.Sobel(bright, -1, 1, 0, ksize=3)) / 4, 0.0) > EDGE_STEP
    rows = np.maximum(known.sum(axis=0), 1)
    edges = upright.sum(axis=0) / np.maximum((known & ~window).sum(axis=0), 1)
    bare = (window.sum(axis=0) / rows <= MAX_WINDOW_SHARE) & (rows > 0.3 * WORKING_ROWS)
    runs = [run for run in _runs(bare) if _are_wide(_strips(*run, size[0], unit), unit)]
    reach = round(STRIP_SHARE * unit / 2)
    found = []
    for place, (start, stop) in enumerate(runs):
        near = _strips(start, stop, size[0], unit)
        profiles = [_ledge_profile(ledges, known, side) for side in near]
        lines = upright[:, start:stop].sum(axis=0) / rows[start:stop]
        lines = uniform_filter1d(lines, 3, mode="constant")  # a line leans by a little
        # left of the party wall the gap continues what is left of it, and right of it what is right
        gain = multiply_matrices(ledges[:, start:stop].T, _normalise(profiles[0]) - _normalise(profiles[1]))
        column = int((np.cumsum(gain) / np.abs(gain).sum().clip(1e-9) + LINE_WEIGHT * lines).argmax())
        pairs = [near]
        # a single column of windows may be a bay, with the facade continuing beyond it
        if place > 0:
            pairs.append((_strips(*runs[place - 1], size[0], unit)[0], near[1]))
        if place + 1 < len(runs):
            pairs.append((near[0], _strips(*runs[place + 1], size[0], unit)[1]))
        mismatches = [_measure_mismatch(ledges, window, known, pair) for pair in pairs]
        around = slice(max(0, start + column - reach), start + column + reach + 1)
        clutter = max(0.0, float(np.median(edges[around])) - MAX_EDGE_SHARE)
        line = float(lines[max(0, column - 2) : column + 3].max()) - clutter
        features = [
            *min(mismatches, key=lambda mismatch: float((mismatch * WEIGHTS[:2]).sum())),
            line,
            (stop - start) / unit,
        ]
        found.append(GapEvidence(round((start + column + 0.5) / scale), np.array(features)))
    return found


def _are_wide(sides: tuple[slice, slice], unit: float) -> bool:
    """Return whether strips are wide enough to compare."""
    return all(side.stop - side.start >= MIN_STRIP_SHARE * unit for side in sides)


def _measure_mismatch(ledges: AnyArray, window: BoolArray, known: BoolArray, pair: tuple[slice, slice]) -> Float64Array:
    """Return the mismatch (2,) of the rows of ledges and of windows between two strips."""
    common = np.logical_and(*(known[:, side].mean(axis=1) > MIN_KNOWN_SHARE for side in pair))
    profiles = [_ledge_profile(ledges, known, side)[common] for side in pair]
    shares = [(window[:, side].sum(axis=1) / np.maximum(known[:, side].sum(axis=1), 1))[common] for side in pair]
    return np.array([1 - _correlation(*profiles), 1 - _correlation(*shares)])


def _runs(mask: BoolArray) -> list[tuple[int, int]]:
    """Return runs of True as (start, stop)."""
    steps = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in steps.reshape(-1, 2)]


def _strips(start: int, stop: int, width: int, unit: float) -> tuple[slice, slice]:
    """Columns on both sides of a gap; `unit` columns are as wide as the picture is high."""
    reach = round(STRIP_SHARE * unit)
    return slice(max(0, start - reach), start), slice(stop, min(width, stop + reach))


def _ledge_profile(ledges: AnyArray, known: BoolArray, side: slice) -> AnyArray:
    """Strength (h,) of the ledges at each row of a strip."""
    profile = ledges[:, side].sum(axis=1) / np.maximum(known[:, side].sum(axis=1), 1)
    smooth: AnyArray = gaussian_filter1d(profile, LEDGE_BLUR_SHARE * WORKING_ROWS)
    return smooth


def _normalise(profile: AnyArray) -> AnyArray:
    """Scale a profile to length 1 around 0."""
    centred = profile - profile.mean()
    normalised: AnyArray = centred / max(float(np.sqrt((centred**2).sum())), 1e-9)
    return normalised


def _correlation(a: AnyArray, b: AnyArray) -> float:
    if len(a) < 8 or a.std() < 1e-9 or b.std() < 1e-9:
        return 0.0
    return float((_normalise(a) * _normalise(b)).sum())


def choose_sides(
    gaps: list[GapEvidence], size: tuple[int, int], centre: float, aspect: float | None, seen: Float64Array
) -> tuple[int, int]:
    """Choose the columns of the facade that a photo is meant for: the most probable pair of sides.

    The sides are gaps or ends of the picture. Gaps within the facade are no party walls, and its sides are; the
    facade is wide, the photo was pointed at it, and it has the wall's proportions if these are known; if not, it has
    at least two columns of windows. A part of the picture that is mostly not seen is no facade.

    Parameters
    ----------
    gaps : evidence of gaps between windows.
    size : height and width of the picture.
    centre : column that the photo was pointed at.
    aspect : width over height of the wall; None if unknown.
    seen : (width,) share of the rows of each column that the photo shows.

    Returns
    -------
    First column, and the one after the last.
    """
    height, width = size
    odds = np.array([party_wall_log_odds(gap.features) for gap in gaps])
    columns = np.array([gap.column for gap in gaps])
    sides = [(0, 0.0), *zip(columns.tolist(), np.logaddexp(0, -odds).tolist(), strict=True), (width, 0.0)]
    place = np.arange(width)
    weight = np.maximum(0.0, 1 - np.abs(place - centre) / (MAX_CENTRE_DISTANCE * width))
    if not weight.any():  # it was pointed at a place far beside the picture
        return 0, width
    total = np.concatenate([[0.0], np.cumsum(weight / weight.sum())])
    area = np.concatenate([[0.0], np.cumsum(seen)])
    aim, reach = min(max(centre, 0.0), float(width)), MAX_AIM_ERROR * height
    best, chosen = -np.inf, (0, width)
    for k, (left, left_cost) in enumerate(sides):
        for right, right_cost in sides[k + 1 :]:
            if right - left < MIN_FACADE_ASPECT * height or not left - reach <= aim <= right + reach:
                continue
            within = (columns > left) & (columns < right)
            is_part = (left, right) != (0, width)
            if is_part and area[right] - area[left] < MIN_SEEN_SHARE * (right - left):
                continue
            if aspect is None and not within.any() and is_part:
                continue
            score = CENTRE_WEIGHT * float(np.log(max(total[right] - total[left], 1e-3)))
            score -= left_cost + right_cost + np.logaddexp(0, odds[within]).sum()
            if aspect is not None:
                score -= (np.log((right - left) / height / aspect) / ASPECT_SIGMA) ** 2 / 2
            if score > best:
                best, chosen = score, (left, right)
    return chosen


def party_wall_log_odds(features: Float64Array) -> float:
    """Logarithm of the odds that a gap is a party wall."""
    return float((features * WEIGHTS).sum() + BIAS)
