"""Segmentation of a wall picture into horizontal bands of one material, and mouldings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.core.linear_light import srgb_to_linear
from facade_core.export.bodies.settings import MOULDINGS


@dataclass(frozen=True)
class WallBand:
    """Horizontal band of a wall: a field of one material, or a moulding.

    Attributes
    ----------
    top, foot : metres from the top of the wall.
    is_moulding : True for a cornice, a string course or the edge of a plinth.
    colour : (3,) mean, linear light.
    profile : (`profile_samples`, 3) colours from its top to its foot, linear light.
    """

    top: float
    foot: float
    is_moulding: bool
    colour: Float32Array
    profile: Float32Array

    @property
    def height(self) -> float:
        """Return the height of the band, metres."""
        return self.foot - self.top


def free_wall_mask(labels: UInt8Array, boxes: Sequence[tuple[float, float, float, float]], density: float) -> BoolArray:
    """Compute the mask of free wall outside of boxes.

    Parameters
    ----------
    labels : (h, w) facade classes.
    boxes : x0, y0, x1, y1 in metres.
    density : texels per metre.

    Returns
    -------
    (h, w) bool.
    """
    free = np.isin(labels, (FacadeClass.WALL, FacadeClass.ROOF))
    for x0, y0, x1, y1 in boxes:
        left, top = (max(0, int((low - MOULDINGS.element_margin_m) * density)) for low in (x0, y0))
        right, foot = (int(np.ceil((high + MOULDINGS.element_margin_m) * density)) for high in (x1, y1))
        free[top:foot, left:right] = False
    return free


def split_wall_into_bands(image: UInt8Array, free: BoolArray, density: float) -> list[WallBand]:
    """Split a wall picture into horizontal bands, from its top.

    Parameters
    ----------
    image : (h, w, 3) uint8.
    free : (h, w) bool, free wall.
    density : texels per metre.
    """
    rows = _row_colours(image, free)
    cuts = [0, *_find_borders(rows, max(1, round(MOULDINGS.step_window_m * density))), len(rows)]
    spans: list[list[int]] = []
    for top, foot in zip(cuts[:-1], cuts[1:], strict=True):
        low = (foot - top) / density < MOULDINGS.max_moulding_height_m
        if spans and low and spans[-1][2]:
            spans[-1][1] = foot
        else:
            spans.append([top, foot, int(low)])
    return [_make_band(rows, top, foot, bool(low) and len(spans) > 1, density) for top, foot, low in spans]


def _find_borders(rows: Float64Array, reach: int) -> list[int]:
    """Find the rows where the mean colours of `reach` rows above and below differ most; rows (h, 3)."""
    height = len(rows)
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(rows, axis=0)])
    at = np.arange(1, height)
    above, below = np.maximum(at - reach, 0), np.minimum(at + reach, height)
    off = (total[at] - total[above]) / (at - above)[:, None] - (total[below] - total[at]) / (below - at)[:, None]
    step = np.concatenate([[0.0], np.abs(off).max(axis=1), [0.0]])
    found: list[int] = []
    for row in np.argsort(-step, kind="stable").tolist():
        if step[row] <= MOULDINGS.min_colour_step:
            break
        highest = step[row] >= step[max(row - 1, 0) : row + 2].max()
        if highest and all(abs(row - other) >= max(2, reach // 2) for other in found):
            found.append(row)
    return sorted(found)


def _make_band(rows: Float64Array, top: int, foot: int, moulding: bool, density: float) -> WallBand:
    light = srgb_to_linear(np.rint(rows[top:foot]).astype(np.uint8))
    places = (np.arange(MOULDINGS.profile_samples) + 0.5) / MOULDINGS.profile_samples * (foot - top) - 0.5
    profile = np.stack([np.interp(places, np.arange(foot - top), light[:, band]) for band in range(3)], axis=1)
    return WallBand(top / density, foot / density, moulding, light.mean(axis=0), profile.astype(np.float32))


def _row_colours(image: UInt8Array, free: BoolArray) -> Float64Array:
    """Return the median colour (h, 3) of the free wall of every row; rows without enough free wall take the nearest."""
    known = np.flatnonzero(free.mean(axis=1) >= MOULDINGS.min_free_share)
    if not len(known):
        return np.tile(np.median(image.reshape(-1, 3), axis=0), (len(image), 1))
    ranked = np.sort(np.where(free[known, :, None], image[known], np.int16(256)), axis=1, kind="stable")
    count = free[known].sum(axis=1)
    medians: Float64Array = (
        ranked[np.arange(len(known)), (count - 1) // 2] + ranked[np.arange(len(known)), count // 2]
    ) / 2.0
    nearest = np.searchsorted((known[1:] + known[:-1]) / 2, np.arange(len(image)))
    return medians[nearest]


def most_similar_band(band: WallBand, others: Sequence[WallBand]) -> int | None:
    """Return the index of the most similar band of the same kind; None if there is none. Mouldings compare heights too."""
    cost = {
        k: float(np.abs(np.sqrt(band.profile) - np.sqrt(one.profile)).mean())
        + (0.15 * abs(float(np.log(band.height / one.height))) if band.is_moulding else 0.0)
        for k, one in enumerate(others)
        if one.is_moulding == band.is_moulding
    }
    return min(cost, key=lambda k: (cost[k], k), default=None)
