"""Eq. 1 of the street paper from a small state per texel, exact in any order of the views (ADR 0010).

A view has an integer distance d in millimetres. Proper views (d within the gate) are averaged with weights 1 - d / sum d,
clamped to [0.3, 0.7], mapped by (w - 0.3) / 0.4 and divided by their sum. A share d / sum d above 0.3 is possible for at most
three views, and every other view sits at the upper clamp: so N, sum d, sum colour and the three largest (d, colour) suffice,
all integers. Without a proper view the one of smallest (d, id) stands in.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

LOW, HIGH = 0.3, 0.7


@dataclass(frozen=True)
class BlendState:
    """State of `total` texels, updated in place by `add_views`.

    count (t,) int32 proper views; distance (t,) int64 their sum of d in mm; colour (t, 3) int64 their sum;
    top_distance (t, 3) int64 and top_colour (t, 3, 3) uint8 the three largest d, descending; stand_in (t, 2) int64 smallest
    (d, id) among the other views, -1 where none, and stand_in_colour (t, 3) uint8.
    """

    count: np.ndarray
    distance: np.ndarray
    colour: np.ndarray
    top_distance: np.ndarray
    top_colour: np.ndarray
    stand_in: np.ndarray
    stand_in_colour: np.ndarray

    @classmethod
    def empty(cls, total: int) -> BlendState:
        return cls(
            count=np.zeros(total, np.int32),
            distance=np.zeros(total, np.int64),
            colour=np.zeros((total, 3), np.int32),
            top_distance=np.full((total, 3), -1, np.int32),
            top_colour=np.zeros((total, 3, 3), np.uint8),
            stand_in=np.full((total, 2), -1, np.int32),
            stand_in_colour=np.zeros((total, 3), np.uint8),
        )

    def arrays(self) -> tuple[np.ndarray, ...]:
        return (
            self.count,
            self.distance,
            self.colour,
            self.top_distance,
            self.top_colour,
            self.stand_in,
            self.stand_in_colour,
        )


@njit(cache=True, inline="always")
def add_view(state, t, d, proper, view, red, green, blue):
    """Add one view of texel t: d in mm, `proper` within the gate, `view` its id, its colour. Called from numba kernels."""
    count, distance, colour, top_distance, top_colour, stand_in, stand_in_colour = state
    if not proper:
        if stand_in[t, 0] < 0 or d < stand_in[t, 0] or (d == stand_in[t, 0] and view < stand_in[t, 1]):
            stand_in[t, 0], stand_in[t, 1] = d, view
            stand_in_colour[t, 0], stand_in_colour[t, 1], stand_in_colour[t, 2] = red, green, blue
        return
    count[t] += 1
    distance[t] += d
    colour[t, 0] += red
    colour[t, 1] += green
    colour[t, 2] += blue
    place = 3
    while place > 0 and d > top_distance[t, place - 1]:
        place -= 1
    for k in range(2, place, -1):
        top_distance[t, k] = top_distance[t, k - 1]
        top_colour[t, k, 0] = top_colour[t, k - 1, 0]
        top_colour[t, k, 1] = top_colour[t, k - 1, 1]
        top_colour[t, k, 2] = top_colour[t, k - 1, 2]
    if place < 3:
        top_distance[t, place] = d
        top_colour[t, place, 0], top_colour[t, place, 1], top_colour[t, place, 2] = red, green, blue


@njit(cache=True)
def add_views(state, texel, d, proper, view, rgb):
    """Add views one by one: texel, d (mm), proper, view (n,) and rgb (n, 3) uint8, into state.arrays()."""
    for i in range(len(texel)):
        add_view(state, texel[i], d[i], proper[i], view[i], rgb[i, 0], rgb[i, 1], rgb[i, 2])


def blend(state: BlendState, texels: slice = slice(None)) -> tuple[np.ndarray, np.ndarray]:
    """Eq. 1 of some texels: colour (t, 3) uint8, rounded to nearest, and how many views made it (t,) uint16."""
    arrays = tuple(array[texels] for array in state.arrays())
    out = np.zeros((len(arrays[0]), 3), np.uint8)
    views = np.zeros(len(arrays[0]), np.uint16)
    _blend(arrays, out, views)
    return out, views


@njit(cache=True, nogil=True)
def _blend(state, out, views):
    count, distance, colour, top_distance, top_colour, stand_in, stand_in_colour = state
    for t in range(len(count)):
        n = count[t]
        if n == 0:
            if stand_in[t, 0] >= 0:
                out[t] = stand_in_colour[t]
                views[t] = 1
            continue
        views[t] = min(n, 65535)
        if n == 1 or distance[t] == 0:
            for c in range(3):
                out[t, c] = int(colour[t, c] / n + 0.5)
            continue
        # every view at the upper clamp (weight 1), then the few largest corrected
        total = float(n)
        r, g, b = float(colour[t, 0]), float(colour[t, 1]), float(colour[t, 2])
        for k in range(min(n, 3)):
            weight = (min(max(1.0 - top_distance[t, k] / distance[t], LOW), HIGH) - LOW) / (HIGH - LOW)
            total += weight - 1.0
            r += (weight - 1.0) * top_colour[t, k, 0]
            g += (weight - 1.0) * top_colour[t, k, 1]
            b += (weight - 1.0) * top_colour[t, k, 2]
        out[t, 0] = int(min(max(r / total, 0.0), 255.0) + 0.5)
        out[t, 1] = int(min(max(g / total, 0.0), 255.0) + 0.5)
        out[t, 2] = int(min(max(b / total, 0.0), 255.0) + 0.5)
