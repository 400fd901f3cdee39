"""Eq. 1 of the street paper from a small state per texel, exact in any order of the views (ADR 0010).

A view has an integer distance d in millimetres. Proper views (d within the gate) are averaged with weights 1 - d / sum d,
clamped to [0.3, 0.7], mapped by (w - 0.3) / 0.4 and divided by their sum. A share d / sum d above 0.3 is possible for at most
three views, and every other view sits at the upper clamp: so N, sum d, sum colour and the three largest (d, colour) suffice,
all integers. Without a proper view the one of smallest (d, id) stands in.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numba import njit

LOW, HIGH = 0.3, 0.7
# Distances up to this many millimetres fit 16 bits.
SHORT_MM = 65_535


@dataclass(frozen=True)
class Weighting:
    """Which reading of Eq. 1 blends the views.

    gated: a view is proper only within 1.5 viewpoint spacings along the street. clamp: "mapped", clamped weights are mapped
    from [0.3, 0.7] to [0, 1]; "sum", they are only divided by their sum; "none", the plain average. resolution: weights are
    also multiplied by the share of the texel's resolution that the view has, which falls with its range and its grazing angle.
    """

    gated: bool = True
    clamp: Literal["mapped", "sum", "none"] = "mapped"
    resolution: bool = False


# As the design pins Eq. 1.
PINNED = Weighting()


@dataclass(frozen=True)
class BlendState:
    """State of `total` texels, updated in place by `add_views`: 33 bytes each, 40 with `Weighting.resolution`.

    count (t,) uint16 proper views; distance (t,) int32 their sum of d in mm; colour (t, 3) int32 their sum, each times its
    quality; top_distance (t, 3) and top_colour (t, 3, 3) uint8 the three largest d, descending, as far as there are views.
    A texel without a proper view keeps its stand-in in the same place: distance is then its id + 1, 0 where there is none
    either, and top_distance and top_colour hold it first. quality (t,) int32 the sum of the views' qualities, 1 to 255, and
    top_quality (t, 3) uint8 those of the three; both are empty where every view has quality 1.
    """

    count: np.ndarray
    distance: np.ndarray
    colour: np.ndarray
    top_distance: np.ndarray
    top_colour: np.ndarray
    quality: np.ndarray
    top_quality: np.ndarray

    @classmethod
    def empty(cls, total: int, *, farthest: int = SHORT_MM, resolution: bool = False) -> BlendState:
        """`farthest` is the largest d in mm that a view may have."""
        return cls(
            count=np.zeros(total, np.uint16),
            distance=np.zeros(total, np.int32),
            colour=np.zeros((total, 3), np.int32),
            top_distance=np.zeros((total, 3), np.uint16 if farthest <= SHORT_MM else np.int32),
            top_colour=np.zeros((total, 3, 3), np.uint8),
            quality=np.zeros(total if resolution else 0, np.int32),
            top_quality=np.zeros((total if resolution else 0, 3), np.uint8),
        )

    def arrays(self) -> tuple[np.ndarray, ...]:
        """What Eq. 1 itself needs."""
        return self.count, self.distance, self.colour, self.top_distance, self.top_colour

    def qualities(self) -> tuple[np.ndarray, np.ndarray]:
        return self.quality, self.top_quality


@njit(cache=True, inline="always")
def stands_in(state, t, d, view):
    """Whether a view beyond the gate would be what texel t shows. Called from numba kernels."""
    count, distance, _, top_distance, _ = state
    if count[t] > 0:
        return False
    held, nearest = np.int64(distance[t]) - 1, np.int64(top_distance[t, 0])
    return held < 0 or d < nearest or (d == nearest and view < held)


@njit(cache=True, inline="always")
def add_view(state, qualities, t, d, proper, view, quality, rgb):
    """Add one view of texel t: d in mm, `proper` within the gate, `view` its id, `quality` 1 to 255, rgb (3,) its colour.
    state and qualities are the arrays of a BlendState. Called from numba kernels."""
    count, distance, colour, top_distance, top_colour = state
    total_quality, top_quality = qualities
    n = int(count[t])
    if not proper:
        if stands_in(state, t, d, view):
            distance[t] = view + 1
            top_distance[t, 0] = d
            for c in range(3):
                top_colour[t, 0, c] = rgb[c]
        return
    weighed = len(total_quality) > 0
    if n == 0:  # a stand-in goes
        distance[t] = 0
    factor = quality if weighed else 1
    count[t] = n + 1
    distance[t] += d
    for c in range(3):
        colour[t, c] += factor * np.int64(rgb[c])
    if weighed:
        total_quality[t] += quality
    place = min(n, 3)
    while place > 0 and d > np.int64(top_distance[t, place - 1]):
        place -= 1
    if place == 3:
        return
    for k in range(min(n, 2), place, -1):
        top_distance[t, k] = top_distance[t, k - 1]
        for c in range(3):
            top_colour[t, k, c] = top_colour[t, k - 1, c]
        if weighed:
            top_quality[t, k] = top_quality[t, k - 1]
    top_distance[t, place] = d
    for c in range(3):
        top_colour[t, place, c] = rgb[c]
    if weighed:
        top_quality[t, place] = quality


@njit(cache=True)
def add_views(state, texel, d, proper, view, rgb):
    """Add views one by one, all of one quality: texel, d (mm), proper, view (n,) and rgb (n, 3) uint8, into state.arrays()."""
    alike = (np.zeros(0, np.int32), np.zeros((0, 3), np.uint8))
    for i in range(len(texel)):
        add_view(state, alike, texel[i], d[i], proper[i], view[i], 1, rgb[i])


def blend(
    state: BlendState, texels: slice = slice(None), weighting: Weighting = PINNED
) -> tuple[np.ndarray, np.ndarray]:
    """Eq. 1 of some texels: colour (t, 3) uint8, rounded to nearest, and how many views made it (t,) uint16."""
    arrays = tuple(array[texels] for array in state.arrays())
    out = np.zeros((len(arrays[0]), 3), np.uint8)
    views = np.zeros(len(out), np.uint16)
    _blend(arrays, (state.quality[texels], state.top_quality[texels]), *clamps(weighting), out, views)
    return out, views


def clamps(weighting: Weighting) -> tuple[bool, float]:
    """Whether shares of the distance count at all, and what weight the lower clamp stands for when the upper one is 1."""
    return weighting.clamp != "none", LOW / HIGH if weighting.clamp == "sum" else 0.0


@njit(cache=True, nogil=True)
def _blend(state, qualities, shared, least, out, views):
    for t in range(len(out)):
        views[t] = blend_texel(state, qualities, t, shared, least, out, t)


@njit(cache=True, inline="always")
def blend_texel(state, qualities, t, shared, least, out, place):
    """Eq. 1 of texel t into out[place]; returns how many views made it. Called from numba kernels; shared and least as of
    `clamps`."""
    count, distance, colour, top_distance, top_colour = state
    total_quality, top_quality = qualities
    n = int(count[t])
    if n == 0:
        if distance[t] == 0:
            return 0
        for c in range(3):
            out[place, c] = top_colour[t, 0, c]
        return 1
    if n == 1:
        for c in range(3):
            out[place, c] = top_colour[t, 0, c]
        return n
    weighed = len(total_quality) > 0
    # every view at the upper clamp (weight 1), then the few largest corrected
    total = float(total_quality[t]) if weighed else float(n)
    r, g, b = float(colour[t, 0]), float(colour[t, 1]), float(colour[t, 2])
    if shared and distance[t] > 0:
        whole = 1.0 / distance[t]
        for k in range(min(n, 3)):
            # the weight of share d / sum d, 1 at the upper clamp and `least` at the lower one
            beyond = min(max(np.int64(top_distance[t, k]) * whole, 1.0 - HIGH), 1.0 - LOW) - (1.0 - HIGH)
            change = -(1.0 - least) / (HIGH - LOW) * beyond
            if weighed:
                change *= top_quality[t, k]
            total += change
            r += change * top_colour[t, k, 0]
            g += change * top_colour[t, k, 1]
            b += change * top_colour[t, k, 2]
    scale = 1.0 / total
    out[place, 0] = int(min(max(r * scale, 0.0), 255.0) + 0.5)
    out[place, 1] = int(min(max(g * scale, 0.0), 255.0) + 0.5)
    out[place, 2] = int(min(max(b * scale, 0.0), 255.0) + 0.5)
    return n
