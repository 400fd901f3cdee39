"""A wall as bands from its top to its foot: what it is of there, and the mouldings between."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from facade_core.core.labels import FacadeClass
from facade_core.core.linear_light import linear

# What is lower is a moulding (a cornice, a string course, a plinth's edge), metres.
LOW_M = 0.7
# So far, in grey levels, the wall's colour changes from row to row where one band ends.
STEP = 11.0
# Of the rows above and below, so many metres: no course of bricks is a band.
LOOKED_M = 0.15
# A row says what the wall is of where so much of it is free.
LEAST_FREE = 0.03
# Around elements so much of the wall is not looked at, metres.
BESIDE_M = 0.1
# A moulding is told by this many colours from its top to its foot.
PROFILE = 12


@dataclass(frozen=True)
class Band:
    """Rows from top to foot, metres from the wall's top; whether it is a moulding; its mean colour (3,), linear light; profile
    (PROFILE, 3), the same from its top to its foot."""

    top: float
    foot: float
    moulding: bool
    colour: np.ndarray
    profile: np.ndarray

    @property
    def height(self) -> float:
        return self.foot - self.top


def free_of(labels: np.ndarray, boxes: Sequence[tuple[float, float, float, float]], density: float) -> np.ndarray:
    """The wall (h, w) bool of labels (h, w) beside boxes (x0, y0, x1, y1), metres."""
    free = np.isin(labels, (FacadeClass.WALL, FacadeClass.ROOF))
    for x0, y0, x1, y1 in boxes:
        left, top = (max(0, int((low - BESIDE_M) * density)) for low in (x0, y0))
        right, foot = (int(np.ceil((high + BESIDE_M) * density)) for high in (x1, y1))
        free[top:foot, left:right] = False
    return free


def bands_of(image: np.ndarray, free: np.ndarray, density: float) -> list[Band]:
    """The bands of a wall, image (h, w, 3) uint8 of which (h, w) bool is free wall, from its top."""
    rows = _profile(image, free)
    cuts = [0, *_borders(rows, max(1, round(LOOKED_M * density))), len(rows)]
    spans: list[list[int]] = []
    for top, foot in zip(cuts[:-1], cuts[1:], strict=True):
        low = (foot - top) / density < LOW_M
        if spans and low and spans[-1][2]:
            spans[-1][1] = foot
        else:
            spans.append([top, foot, int(low)])
    return [_band(rows, top, foot, bool(low) and len(spans) > 1, density) for top, foot, low in spans]


def _borders(rows: np.ndarray, reach: int) -> list[int]:
    """Where the means of so many rows above and below differ most, and by more than STEP; rows (h, 3)."""
    height = len(rows)
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(rows, axis=0)])
    at = np.arange(1, height)
    above, below = np.maximum(at - reach, 0), np.minimum(at + reach, height)
    off = (total[at] - total[above]) / (at - above)[:, None] - (total[below] - total[at]) / (below - at)[:, None]
    step = np.concatenate([[0.0], np.abs(off).max(axis=1), [0.0]])
    found: list[int] = []
    for row in np.argsort(-step, kind="stable").tolist():
        if step[row] <= STEP:
            break
        highest = step[row] >= step[max(row - 1, 0) : row + 2].max()
        if highest and all(abs(row - other) >= max(2, reach // 2) for other in found):
            found.append(row)
    return sorted(found)


def _band(rows: np.ndarray, top: int, foot: int, moulding: bool, density: float) -> Band:
    light = linear(np.rint(rows[top:foot]).astype(np.uint8))
    places = (np.arange(PROFILE) + 0.5) / PROFILE * (foot - top) - 0.5
    profile = np.stack([np.interp(places, np.arange(foot - top), light[:, band]) for band in range(3)], axis=1)
    return Band(top / density, foot / density, moulding, light.mean(axis=0), profile.astype(np.float32))


def _profile(image: np.ndarray, free: np.ndarray) -> np.ndarray:
    """The median colour (h, 3) of the free wall of every row, that of the next row where too little is free."""
    known = np.flatnonzero(free.mean(axis=1) >= LEAST_FREE)
    if not len(known):
        return np.tile(np.median(image.reshape(-1, 3), axis=0), (len(image), 1))
    medians = np.array([np.median(image[row][free[row]], axis=0) for row in known.tolist()])
    nearest = np.searchsorted((known[1:] + known[:-1]) / 2, np.arange(len(image)))
    return medians[nearest]


def like(band: Band, others: Sequence[Band]) -> int | None:
    """The most alike of other bands of its kind, mouldings by their height too; None where there is none."""
    cost = {
        k: float(np.abs(np.sqrt(band.profile) - np.sqrt(one.profile)).mean())
        + (0.15 * abs(float(np.log(band.height / one.height))) if band.moulding else 0.0)
        for k, one in enumerate(others)
        if one.moulding == band.moulding
    }
    return min(cost, key=lambda k: (cost[k], k), default=None)
