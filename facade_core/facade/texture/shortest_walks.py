"""Cheapest walks over the floors or bays of an exemplar: where to repeat, where to skip."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, Int64Array, UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.facade.texture.settings import RETARGETING

# Classes that no cut should end at another class.
_UNCUT_CLASSES = (FacadeClass.BALCONY, FacadeClass.WINDOW, FacadeClass.DOOR)


def part_transition_costs(image: UInt8Array, labels: UInt8Array, cuts: Int64Array) -> Float64Array:
    """Return the price (B, B) of showing part b after part a.

    The natural successor of a is compared with b on both sides of the cut; [a, a + 1] is 0.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    labels : (H, W) uint8 class ids.
    cuts : (B + 1,) borders of the parts along axis 1.
    """
    last = image.shape[1] - 1
    count = len(cuts) - 1
    strip = np.clip(np.asarray(cuts)[:, None] + np.arange(-RETARGETING.cut_reach_px, RETARGETING.cut_reach_px), 0, last)
    seen = (image[:, strip].astype(np.float32) / 255.0).transpose(1, 0, 2, 3)
    label = labels[:, np.clip(np.asarray(cuts), 0, last)].T
    before = labels[:, np.clip(np.asarray(cuts) - 1, 0, last)].T
    cut_before, cut_after = (np.isin(one, _UNCUT_CLASSES) for one in (before, label))
    broken = [_cut_share(one, other) for one, other in zip(before, label, strict=True)]
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
            joint = (before[end] != label[start]) & (cut_before[end] | cut_after[start])
            price[a, b] = (
                RETARGETING.jump_price
                + differ
                + RETARGETING.mismatch_price * joint.mean()
                + RETARGETING.cut_price * max(broken[end], broken[start])
                + RETARGETING.repeat_price * (a == b)
            )
    price[np.arange(count - 1), np.arange(1, count)] = 0.0
    return price


def _cut_share(before: UInt8Array, after: UInt8Array) -> float:
    """Return the share of a cut that runs through one window, door or shop."""
    same = before == after
    return float(
        (same & np.isin(before, (FacadeClass.WINDOW, FacadeClass.DOOR))).mean()
        + 0.05 * (same & (before == FacadeClass.SHOP)).mean()
    )


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
