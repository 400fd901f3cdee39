"""Foot of a photographed facade that is hidden as a whole: what stands above it goes on down to the ground.

Inpainting has no source there: the rows beside a hidden foot are hidden too, and nothing below it says where a storey ends.
Storeys are repeated. Below a ground floor there are none: its own lower part is repeated. Nor are there any below the ground
that a picture shows before a wall which reaches deeper in the model: bare wall goes on there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from facade_core.core.arrays import BoolArray, Float64Array, Int64Array, UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.facade.texture.settings import HIDDEN_FOOT
from facade_core.facade.wall_material import lit_colour
from facade_core.parsing.floor_structure import FloorsAndBays, find_floors_and_bays


class Storey(NamedTuple):
    """Rows of a storey: its top, those of its windows, and its bottom."""

    top: int
    window_top: int
    window_bottom: int
    bottom: int

    @property
    def height(self) -> int:
        """Return its number of rows."""
        return self.bottom - self.top


class HiddenFoot(NamedTuple):
    """Hidden foot of a facade.

    Attributes
    ----------
    top : its first row.
    start : row at which the first repetition begins, at or above `top`.
    storey : storey that is repeated, or that is as high as the ground floor.
    ground : first row of bare wall, below the ground or of a foot too low for a storey.
    ground_floor : first row of the lower part of a ground floor above the foot, which goes on; None without any.
    """

    top: int
    start: int
    storey: Storey
    ground: int
    ground_floor: int | None = None


def find_hidden_foot(
    image: UInt8Array, hidden: BoolArray, labels: UInt8Array, outside: BoolArray | None = None
) -> HiddenFoot | None:
    """Find the hidden foot of a facade and the storey to repeat there; None without either.

    Parameters
    ----------
    image : (h, w, 3) uint8.
    hidden : (h, w) bool pixels that do not show the facade.
    labels : (h, w) uint8 class ids; they count where the facade is seen.
    outside : (h, w) bool street below the wall, and what is beside it; None without any.
    """
    is_seen = hidden.mean(axis=0) <= 1 - HIDDEN_FOOT.min_seen_column_share
    image, hidden, labels = image[:, is_seen], hidden[:, is_seen], labels[:, is_seen]
    height = len(hidden)
    if not is_seen.any():
        return None
    is_hidden = hidden.mean(axis=1) >= HIDDEN_FOOT.min_hidden_row_share
    top = height - int(np.logical_and.accumulate(is_hidden[::-1]).sum())
    if (
        not (1 - HIDDEN_FOOT.max_height_share) * height <= top < height
        or hidden[top:].mean() < HIDDEN_FOOT.min_hidden_share
    ):
        return None
    shown = np.where(hidden, FacadeClass.WALL, labels)[:top].astype(np.uint8)
    found = find_floors_and_bays(shown)
    storey = None if found is None else _choose_storey(found, hidden, shown)
    if found is None or storey is None or height - top < HIDDEN_FOOT.min_height_storeys * storey.height:
        return None
    ground = height if outside is None else _find_ground(outside[:, is_seen], top, storey.height)
    ground_floor = _find_ground_floor(shown, hidden, found, storey.height)
    if ground_floor is not None:
        return HiddenFoot(top, top, storey, ground, (ground_floor + top) // 2)
    if ground - top < HIDDEN_FOOT.min_height_storeys * storey.height:
        return HiddenFoot(top, top, storey, top)
    start = found.floors[-1][0] - (storey.window_top - storey.top)  # at the last windows, which the foot may cut
    start += max(0, top - start) // storey.height * storey.height
    start = min(start, top)
    rows, source = slice(start, top), slice(storey.top, storey.top + top - start)
    seen, window, grey = ~(hidden[rows] | hidden[source]), labels == FacadeClass.WINDOW, image.mean(axis=2)
    above = storey.window_top - storey.top + HIDDEN_FOOT.step_tolerance_storeys * storey.height
    in_step = top - start <= above or any(
        _correlate(picture[rows][seen], picture[source][seen]) >= HIDDEN_FOOT.min_correlation
        for picture in (grey, window.astype(np.float64))
    )
    return HiddenFoot(top, start if in_step else top, storey, ground)


def repeat_storeys(
    image: UInt8Array, hidden: BoolArray, labels: UInt8Array, foot: HiddenFoot
) -> tuple[UInt8Array, BoolArray, UInt8Array]:
    """Repeat the storey of a facade over its hidden foot, in the light of the storey above, or continue its ground floor.

    Windows keep their height. The wall below the last windows takes what is left. The lower half of a
    ground floor is repeated mirrored; its upper half has signs.

    Parameters
    ----------
    image, hidden, labels : as in `find_hidden_foot`.
    foot : the hidden foot.

    Returns
    -------
    Image and labels with the foot, and what is still to be inpainted, (h, w) bool: a seam, and what is hidden above the foot or
    in the repeated storey.
    """
    if foot.ground_floor is not None:
        rows, gain = _back_and_forth(foot.ground_floor, foot.top, foot.ground - foot.top), 1.0
    else:
        rows = _source_rows(foot.storey, foot.ground - foot.start)[foot.top - foot.start :]
        gain = _foot_gain(image, hidden, labels, foot)
    repeated, missing, classes = image.copy(), hidden.copy(), labels.copy()
    above, below = slice(foot.top, foot.ground), slice(foot.ground, None)
    repeated[above] = np.clip(np.rint(image[rows] * gain), 0, 255).astype(np.uint8)
    missing[above], classes[above] = hidden[rows], labels[rows]
    repeated[below] = _wall_colours(image, hidden, labels, foot)
    missing[below], classes[below] = False, FacadeClass.WALL
    missing[foot.top : foot.top + max(1, round(HIDDEN_FOOT.seam_storeys * foot.storey.height))] = True
    return repeated, missing, classes


def _wall_colours(image: UInt8Array, hidden: BoolArray, labels: UInt8Array, foot: HiddenFoot) -> UInt8Array:
    """Return the mean colour (w, 3) of the wall around each column, from the repeated storey down to the foot."""
    rows = slice(foot.storey.top, foot.top)
    wall = ((labels == FacadeClass.WALL) & ~hidden)[rows, :, None]
    reach = max(1, round(HIDDEN_FOOT.wall_colour_reach_storeys * foot.storey.height))
    total, count = (
        ndimage.uniform_filter1d(part.sum(axis=0, dtype=np.float64), 2 * reach + 1, axis=0, mode="nearest")
        for part in (image[rows] * wall, wall)
    )
    everywhere = image[rows].mean(axis=(0, 1))
    colours: Float64Array = np.where(count > 0, total / np.maximum(count, 1e-9), everywhere)
    return np.rint(colours).astype(np.uint8)


def _find_ground(outside: BoolArray, top: int, storey: int) -> int:
    """Return the median first row of street over the columns that show it below a row; the height (h, w) if few do."""
    is_neighbour = outside[max(0, top - storey)]
    below = outside[top:, ~is_neighbour]
    shows = below.any(axis=0)
    if not shows.any() or shows.mean() < HIDDEN_FOOT.min_street_columns:
        return len(outside)
    return top + int(np.median(below.argmax(axis=0)[shows]))


def _back_and_forth(first: int, last: int, count: int) -> Int64Array:
    """Return so many rows from the last of a range up to the first, down again, and so on."""
    there = np.arange(first, last)
    return np.resize(np.concatenate([there[::-1], there]), count)


def _find_ground_floor(labels: UInt8Array, hidden: BoolArray, found: FloorsAndBays, storey: int) -> int | None:
    """Return the first row of a ground floor at the lower end of labels (h, w), None without any there.

    It has shops or doors, higher windows, or windows in other places than the storeys above.
    """
    share = np.isin(labels, (FacadeClass.SHOP, FacadeClass.DOOR)).mean(axis=1) >= HIDDEN_FOOT.min_ground_floor_share
    heights = [last - first for first, last in found.floors]
    seen = hidden[slice(*found.floors[-1])].mean(axis=0) <= HIDDEN_FOOT.max_hidden_source_share
    *others, lowest = [(labels[first:last] == FacadeClass.WINDOW).mean(axis=0)[seen] for first, last in found.floors]
    usual = np.median(others, axis=0)
    has_bays = seen.any() and max(usual.std(), lowest.std()) > 0
    if heights[-1] > HIDDEN_FOOT.usual_windows[1] * np.median(heights) or (
        has_bays and _correlate(lowest, usual) < HIDDEN_FOOT.min_correlation
    ):
        share[slice(*found.floors[-1])] = True
    below = int(np.argmax(share[::-1])) if share.any() else storey
    if below >= HIDDEN_FOOT.max_plinth_storeys * storey:
        return None
    bottom = len(share) - below
    return bottom - int(np.logical_and.accumulate(share[:bottom][::-1]).sum())


def _foot_gain(image: UInt8Array, hidden: BoolArray, labels: UInt8Array, foot: HiddenFoot) -> float:
    """Return the factor from the wall of the repeated storey to that of as many rows above the foot.

    It is one for all channels, as dark walls have noise for a hue. The lit colour and the median must both say so: loggias of
    one part have shadow, and panels of another are light.
    """
    storey, wall = foot.storey, (labels == FacadeClass.WALL) & ~hidden
    parts = slice(storey.top, storey.bottom), slice(max(0, foot.top - storey.height), foot.top)
    if any(wall[part].mean() < HIDDEN_FOOT.min_wall_share for part in parts):
        return 1.0
    ratios = []
    for colour in (lit_colour, _median_colour):
        source, above = (float(colour(image[part][wall[part]]).mean()) + 1 for part in parts)
        ratios.append(float(np.clip(above / source, 1 / HIDDEN_FOOT.max_gain, HIDDEN_FOOT.max_gain)))
    low, high = min(ratios), max(ratios)
    return low if low > 1 else high if high < 1 else 1.0


def _median_colour(pixels: UInt8Array) -> Float64Array:
    return np.asarray(np.median(pixels, axis=0), np.float64)


def _choose_storey(found: FloorsAndBays, hidden: BoolArray, labels: UInt8Array) -> Storey | None:
    """Return the lowest usual storey that is seen, resembles the others and has the fewest balconies.

    The last floor may be cut by the foot. The storey is as high as storeys are on the median, so that repeated windows stay
    in step with the others.
    """
    pitches = np.diff([first for first, _ in found.floors])
    if not len(pitches):
        return None
    pitch = round(float(np.median(pitches)))
    is_usual = _are_within(pitches, HIDDEN_FOOT.usual_heights)
    has_usual_windows = _are_within(np.array([last - first for first, last in found.floors]), HIDDEN_FOOT.usual_windows)
    storeys = []
    for k, windows in enumerate(found.floors):
        top = found.floor_cuts[k] if k else found.floor_cuts[1] - pitch  # over the first floor is an attic, or a roof
        storey = Storey(top, *windows, top + pitch)
        usual = is_usual[max(0, k - 1) : k + 1].any() and has_usual_windows[k]
        is_whole = 0 <= top < windows[0] and windows[1] < storey.bottom <= len(labels)
        if found.kinds[k] == "middle" and usual and is_whole:
            storeys.append(storey)

    seen = [one for one in storeys if hidden[one.top : one.bottom].mean() <= HIDDEN_FOOT.max_hidden_source_share]
    if not seen:
        return None
    is_window = labels == FacadeClass.WINDOW
    likeness = _likeness_to_others(
        [np.roll(is_window[one.top : one.bottom], one.top - one.window_top, axis=0) for one in seen]
    )
    balconies = [(labels[one.top : one.bottom] == FacadeClass.BALCONY).mean() for one in seen]
    usual_ones = np.flatnonzero(likeness >= likeness.max() - HIDDEN_FOOT.max_likeness_loss).tolist()
    return seen[min(usual_ones, key=lambda k: (int(balconies[k] / HIDDEN_FOOT.balcony_step_share), -seen[k].top))]


def _likeness_to_others(windows: Sequence[BoolArray]) -> Float64Array:
    """Return the median correlation (n,) of the windows of each storey, (h, w) bool, with those of the others."""
    values = [one.astype(np.float64) for one in windows]
    pairs = np.array([[_correlate(one.ravel(), other.ravel()) for other in values] for one in values])
    others = ~np.eye(len(values), dtype=bool)
    return np.array([np.median(row[other]) if other.any() else 1.0 for row, other in zip(pairs, others, strict=True)])


def _are_within(sizes: Int64Array, limits: tuple[float, float]) -> BoolArray:
    """Return which sizes (n,) are within a range over their median."""
    shares = sizes / np.median(sizes)
    return np.asarray((shares >= limits[0]) & (shares <= limits[1]))


def _source_rows(storey: Storey, height: int) -> Int64Array:
    """Return the rows of the image that are shown on a foot of some rows, from its top."""
    count = max(1, int(height / storey.height + 1 - HIDDEN_FOOT.min_last_storeys))
    last = height - (count - 1) * storey.height
    window = min(storey.window_bottom - storey.window_top, round(0.75 * last))
    above = min(storey.window_top - storey.top, last - window)
    below = np.arange(storey.window_bottom, storey.bottom)
    rest = last - window - above
    if rest > len(below):  # mirrored wall between sill or balcony, and the next lintel
        first, last = len(below) // 3, max(1, 2 * len(below) // 3)
        below = below[np.concatenate([np.arange(last), _back_and_forth(first, last, rest - last)])]
    return np.concatenate(
        [
            np.tile(np.arange(storey.top, storey.bottom), count - 1),
            np.arange(storey.window_top - above, storey.window_top),
            storey.window_top + np.arange(window) * (storey.window_bottom - storey.window_top) // max(1, window),
            below[:rest],
        ]
    ).astype(np.int64)


def _correlate(first: Float64Array, second: Float64Array) -> float:
    """Return the correlation of values (n,); 0 where they are even."""
    if len(first) < 2 or not (first.std() > 0 and second.std() > 0):
        return 0.0
    return float(np.corrcoef(first, second)[0, 1])
