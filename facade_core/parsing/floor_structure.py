"""Floors and bays of a labelled facade, and cuts between them that miss every element."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from facade_core.core.arrays import BoolArray, Float64Array, UInt8Array
from facade_core.core.labels import UNKNOWN, FacadeClass
from facade_core.core.types import Lattice

Span = tuple[int, int]
# Space under the lowest row of windows is a floor from this share of the other floors' height on; a base is
# lower.
_MIN_GROUND_RATIO = 0.5
# Under a single row it is a floor from this share of the facade
_MIN_GROUND_SHARE = 0.35
# and this many window heights on.
_MIN_GROUND_WINDOWS = 1.3


@dataclass(frozen=True, slots=True)
class FloorsAndBays:
    """Spans of floors and bays and the cuts between them, in pixels of the label map.

    Attributes
    ----------
    floors : window span (top, bottom) of every floor, top first.
    kinds : "roof", "middle" or "ground" for each floor.
    bays : window span (left, right) of every bay.
    floor_cuts : borders of the floors, one more than floors.
    bay_cuts : borders of the bays, one more than bays.
    top : first row of the facade.
    ground_top : first row of the ground floor, which is no floor of its own without windows.
    bottom : row below the facade.
    """

    floors: tuple[Span, ...]
    kinds: tuple[str, ...]
    bays: tuple[Span, ...]
    floor_cuts: tuple[int, ...]
    bay_cuts: tuple[int, ...]
    top: int
    ground_top: int
    bottom: int

    @property
    def has_ground_band(self) -> bool:
        """Return True if a ground floor without a row of windows is tall enough to count as a floor."""
        if self.kinds[-1] == "ground":
            return False
        if len(self.floors) == 1:
            ((top, below),) = self.floors
            least = max(_MIN_GROUND_SHARE * (self.bottom - self.top), _MIN_GROUND_WINDOWS * (below - top))
            return self.bottom - self.floor_cuts[-1] >= least
        pitches = np.diff(self.floor_cuts)
        middle = np.median([pitch for pitch, kind in zip(pitches, self.kinds, strict=True) if kind == "middle"])
        return bool(self.bottom - self.floor_cuts[-1] >= _MIN_GROUND_RATIO * middle)

    @property
    def floor_count(self) -> int:
        """Return the rows of windows, including those of the roof, and the ground floor."""
        return len(self.floors) + self.has_ground_band


def count_floors(labels: UInt8Array) -> int:
    """Count the floors of a label map (H, W), including the ground floor and roof windows; 0 without windows."""
    structure = find_floors_and_bays(labels)
    return structure.floor_count if structure else 0


def spans_above_threshold(profile: Float64Array, threshold: float) -> list[Span]:
    """Return half-open spans over which a profile (n,) exceeds a threshold."""
    inside = np.concatenate([[False], profile > threshold, [False]])
    edges = np.flatnonzero(inside[1:] != inside[:-1])
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def window_row_spans(window: BoolArray) -> list[Span]:
    """Find the spans of rows with windows in a mask (H, W) bool, one per floor, top first.

    In these rows the window profile exceeds a quarter of its typical peak. Spans below a third of the median height are
    dropped, and spans closer than a fifth of it are joined.
    """
    profile = gaussian_filter1d(window.mean(1), 1.0)
    if profile.max() <= 0.0:
        return []
    spans = spans_above_threshold(profile, 0.25 * float(np.quantile(profile[profile > 0.1 * profile.max()], 0.75)))
    height = np.median([b - a for a, b in spans])
    joined: list[Span] = []
    for a, b in spans:
        if joined and a - joined[-1][1] < 0.2 * height:
            joined[-1] = (joined[-1][0], b)
        elif b - a >= height / 3:
            joined.append((a, b))
    return joined


def find_floors_and_bays(labels: UInt8Array) -> FloorsAndBays | None:
    """Find the floors and bays of a label map (H, W); None without windows.

    The sky above the roof is excluded: `top` is the first row with less than a tenth of sky.
    """
    height, width = labels.shape
    sky = (labels == FacadeClass.SKY).mean(1)
    is_clear = np.flatnonzero(sky < 0.1)
    top = int(is_clear[0]) if len(is_clear) and is_clear[0] < 0.6 * height else 0
    window = labels == FacadeClass.WINDOW
    top = _move_off_windows(window, top)
    window[:top] = False
    floors = window_row_spans(window)
    if not floors:
        return None
    kinds = _floor_kinds(labels, floors, top)
    if kinds[-1] == "ground" and len(floors) > 1:
        shares = [float(window[a:b].any(0).mean()) for a, b in floors]
        if shares[-1] < 0.6 * np.median(shares[:-1]):  # few windows between shops are no floor
            floors, kinds = floors[:-1], kinds[:-1]
    middle = [span for span, kind in zip(floors, kinds, strict=True) if kind == "middle"] or floors
    rows = np.concatenate([np.arange(a, b) for a, b in middle])
    bays = window_row_spans(window[rows].T)
    ground_top = _ground_top(labels, floors, kinds)
    element = (
        4.0 * np.isin(labels, (FacadeClass.WINDOW, FacadeClass.DOOR))
        + 1.0 * (labels == FacadeClass.BALCONY)
        + 0.5 * (labels == FacadeClass.SHOP)
    )
    floor_cuts = [top]
    for upper, lower in zip(floors, floors[1:], strict=False):
        if lower[0] >= ground_top > upper[0]:
            floor_cuts.append(max(ground_top, floor_cuts[-1] + 1))
        else:
            floor_cuts.append(_cut(element.mean(1), upper[1], lower[0], 0.65))
    if kinds[-1] != "ground":
        floor_cuts.append(max(ground_top, floors[-1][1]))
    bottom = height
    if kinds[-1] == "ground":
        floor_cuts.append(bottom)
    across = element[floors[0][0] :].mean(0)
    bay_cuts = [0, *(_cut(across, a[1], b[0], 0.5) for a, b in zip(bays, bays[1:], strict=False)), width]
    return FloorsAndBays(tuple(floors), kinds, tuple(bays), tuple(floor_cuts), tuple(bay_cuts), top, ground_top, bottom)


def _move_off_windows(window: BoolArray, top: int) -> int:
    """Top row that cuts no window: below windows that are mostly above it, else above them."""
    for a, b in spans_above_threshold(window.mean(1), 0.0):
        if a < top < b:
            return a if top - a <= b - top else b
    return top


def _floor_kinds(labels: UInt8Array, floors: list[Span], top: int) -> tuple[str, ...]:
    """Kind of each floor: roof if roof surrounds its windows; ground if it is the lowest one, with doors or shops."""
    kinds = []
    for k, (a, b) in enumerate(floors):
        band = labels[a:b]
        roof, wall = (
            (band == FacadeClass.ROOF).mean(),
            np.isin(band, (FacadeClass.WALL, FacadeClass.BALCONY, FacadeClass.SHOP, FacadeClass.DOOR)).mean(),
        )
        street = np.isin(band, (FacadeClass.DOOR, FacadeClass.SHOP)).any(axis=0).mean()
        if roof > wall and k < len(floors) - 1:
            kinds.append("roof")
        elif k == len(floors) - 1 and (street > 0.04 or labels.shape[0] - b < 0.7 * (b - a)):
            kinds.append("ground")
        else:
            kinds.append("middle")
    if "middle" not in kinds:
        last = len(kinds) - 1
        kinds = ["middle" if k == max(0, last - 1) else kind for k, kind in enumerate(kinds)]
    return tuple(kinds)


def _ground_top(labels: UInt8Array, floors: list[Span], kinds: tuple[str, ...]) -> int:
    """Top of the band of doors and shops below the last upper floor; the bottom where there is none."""
    above = [span for span, kind in zip(floors, kinds, strict=True) if kind != "ground"]
    height = labels.shape[0]
    lowest = above[-1][1] if above else 0
    street = np.asarray(np.isin(labels, (FacadeClass.DOOR, FacadeClass.SHOP)).any(1))
    street[:lowest] = False
    tops = np.flatnonzero(street)
    ground = floors[-1][0] if kinds[-1] == "ground" else height
    first = min(int(tops[0]) if len(tops) else ground, ground)
    if first >= height:  # a plain base: everything under the lowest floor's sill and balcony
        balcony = np.flatnonzero((labels[lowest:] == FacadeClass.BALCONY).mean(1) > 0.02)
        first = lowest + (int(balcony[-1]) + 1 if len(balcony) else 0)
        top: int = min(height, first + max(2, (height - first) // 4))
        return top
    return _cut(
        np.isin(labels, (FacadeClass.WINDOW, FacadeClass.BALCONY, FacadeClass.DOOR, FacadeClass.SHOP)).mean(1),
        lowest,
        first,
        0.8,
    )


def _cut(cost: Float64Array, start: int, stop: int, preferred: float) -> int:
    """Cheapest position in the gap between two elements, near a preferred fraction of it."""
    if stop - start < 2:
        return max(start, 1)
    at = np.arange(start, stop + 1)
    fraction = (at - start) / (stop - start)
    between = np.maximum(cost[np.minimum(at, len(cost) - 1)], cost[np.maximum(at - 1, 0)])
    return int(at[np.argmin(between + 0.1 * np.abs(fraction - preferred))])


def floor_bay_lattice(structure: FloorsAndBays) -> Lattice:
    """Build a lattice of three rows per floor and three columns per bay: before, across and after its windows.

    The roof and the ground floor get one row each.
    """
    rows = [structure.top]
    for (a, b), low in zip(structure.floors, structure.floor_cuts[1:], strict=True):
        rows += [_clamp_between(a, rows[-1], low, 2), _clamp_between(b, a, low, 1), low]
    if rows[-1] < structure.bottom:
        rows.append(structure.bottom)
    columns = [0]
    for (a, b), right in zip(structure.bays, structure.bay_cuts[1:], strict=True):
        columns += [_clamp_between(a, columns[-1], right, 2), _clamp_between(b, a, right, 1), right]
    return Lattice(tuple(rows), tuple(columns))


def _clamp_between(position: int, low: int, high: int, room: int) -> int:
    return min(max(position, low + 1), high - room)


def fill_sky_and_unknown(labels: UInt8Array) -> UInt8Array:
    """Relabel remaining sky around chimneys and roof lines as roof, and unknown pixels (H, W) as wall."""
    return np.where(
        labels == FacadeClass.SKY, FacadeClass.ROOF, np.where(labels == UNKNOWN, FacadeClass.WALL, labels)
    ).astype(np.uint8)
