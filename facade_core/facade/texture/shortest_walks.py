"""Cheapest walks over the floors or bays of an exemplar: where to repeat, where to skip."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, Int64Array, IntArray, UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.facade.texture.settings import RETARGETING

# Price of a border through an element: more than that of any walk without one.
CUT_PRICE = 1000.0
_OPENINGS = (FacadeClass.BALCONY, FacadeClass.WINDOW, FacadeClass.DOOR)
_ELEMENTS = (*_OPENINGS, FacadeClass.SHOP)


class WalkCosts(NamedTuple):
    """Prices of walks over the parts of an exemplar; CUT_PRICE and more where a border cuts an element.

    Attributes
    ----------
    step : (B, B) price of showing part b after part a; [a, a + 1] is 0.
    start, end : (B,) price of the first and the last part.
    """

    step: Float64Array
    start: Float64Array
    end: Float64Array

    def cuts_elements(self, walk: IntArray) -> bool:
        """Return whether a walk (n,) cuts an element."""
        prices = [*self.step[walk[:-1], walk[1:]], self.start[walk[0]], self.end[walk[-1]]]
        return bool(max(prices) >= CUT_PRICE)


def part_transition_costs(image: UInt8Array, labels: UInt8Array, cuts: Int64Array, bands: Sequence[int]) -> WalkCosts:
    """Return the prices of walks over parts.

    The natural successor of a is compared with b on both sides of the cut. A step cuts a door that crosses it, and other
    elements that do not go on in their band.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    labels : (H, W) uint8 class ids.
    cuts : (B + 1,) borders of the parts along axis 1.
    bands : borders of the bands along axis 0.
    """
    last, cuts = image.shape[1] - 1, np.asarray(cuts)
    count = len(cuts) - 1
    strip = np.clip(cuts[:, None] + np.arange(-RETARGETING.cut_reach_px, RETARGETING.cut_reach_px), 0, last)
    seen = (image[:, strip].astype(np.float32) / 255.0).transpose(1, 0, 2, 3)
    label, before = labels[:, np.clip(cuts, 0, last)].T, labels[:, np.clip(cuts - 1, 0, last)].T
    is_opening_before, is_opening = np.isin(before, _OPENINGS), np.isin(label, _OPENINGS)
    crossing = find_crossing_elements(labels, cuts.tolist(), bands)
    is_cut = price_cut_elements(crossing, crossing)
    price = np.empty((count, count))
    for a in range(count):
        for b in range(count):
            end, start = a + 1, b
            colour = np.abs(seen[end] - seen[start])
            # Beyond a border of the facade there is nothing to compare.
            kept = [colour[:, : RETARGETING.cut_reach_px]] * (start > 0) + [colour[:, RETARGETING.cut_reach_px :]] * (
                end < count
            )
            differ = float(np.mean([part.mean() for part in kept])) if kept else 0.5
            joint = (before[end] != label[start]) & (is_opening_before[end] | is_opening[start])
            price[a, b] = (
                RETARGETING.jump_price
                + differ
                + RETARGETING.mismatch_price * joint.mean()
                + is_cut[end, start]
                + RETARGETING.repeat_price * (a == b)
            )
    price[np.arange(count - 1), np.arange(1, count)] = 0.0
    outer = (np.arange(count + 1) % count > 0) + is_cut[0]
    return WalkCosts(price, outer[:-1], outer[1:])


def find_crossing_elements(labels: UInt8Array, cuts: Sequence[int], bands: Sequence[int]) -> Int64Array:
    """Find the elements that cross cuts: (bands, cuts) sums of the bits of their classes, none at the outer cuts.

    Parameters
    ----------
    labels : (H, W) uint8 class ids.
    cuts : cuts along axis 1.
    bands : borders of bands along axis 0.
    """
    inner, tall = np.asarray(cuts)[1:-1], np.asarray(bands)
    after = labels[tall[0] : tall[-1], inner]
    same = after == labels[tall[0] : tall[-1], inner - 1]
    found = np.zeros((len(tall) - 1, len(cuts)), np.int64)
    for element in _ELEMENTS:
        long = np.add.reduceat((same & (after == element)).astype(np.int64), tall[:-1] - tall[0], axis=0)
        found[:, 1:-1] += (long >= RETARGETING.min_cut_px).astype(np.int64) << int(element)
    return found


def price_cut_elements(after: Int64Array, before: Int64Array) -> Float32Array:
    """Return the price (n, m) of cuts with elements (bands, n) of a part after (bands, m) of another before them."""
    one, other = after[:, :, None], before[:, None]
    is_cut = (one != other) | ((one | other) >> int(FacadeClass.DOOR) & 1 > 0)
    return np.asarray(CUT_PRICE * is_cut.any(axis=0), np.float32)


def cheapest_walk(
    price: Float64Array,
    start: Float64Array,
    end: Float64Array,
    length: int,
    *,
    marked: BoolArray | None = None,
    max_marked: int = 0,
) -> Int64Array:
    """Return the cheapest sequence of `length` parts.

    Parameters
    ----------
    price : (B, B) price of every step.
    start, end : (B,) price of the first and the last part.
    length : number of parts.
    marked : (B,) bool parts (those with a door) to show at least once and at most `max_marked` times, where possible.
    max_marked : see `marked`.

    Returns
    -------
    (length,) part indices.
    """
    count = len(price)
    flags = np.zeros(count, int) if marked is None else marked.astype(int)
    levels = (max_marked if marked is not None else 0) + 1
    score = np.full((levels, count), np.inf)
    for b in range(count):
        if flags[b] < levels:
            score[flags[b], b] = start[b]
    came = np.zeros((length, levels, count), int)
    for step in range(1, length):
        following = np.full_like(score, np.inf)
        for b in range(count):
            for level in range(flags[b], levels):
                options = score[level - flags[b]] + price[:, b]
                came[step, level, b] = int(np.argmin(options))
                following[level, b] = options.min()
        score = following
    finish = score + end[None]
    least = 1 if marked is not None and marked.any() else 0
    if not np.isfinite(finish[least:]).any():
        return cheapest_walk(price, start, end, length)
    finish[:least] = np.inf
    level, part = divmod(int(np.argmin(finish)), count)
    walk = [part]
    for step in range(length - 1, 0, -1):
        previous = came[step, level, walk[-1]]
        level -= int(flags[walk[-1]])
        walk.append(int(previous))
    return np.array(walk[::-1])
