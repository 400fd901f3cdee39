"""Eq. 1 of the street paper from a small state per texel (docs/decisions/0010).

Exact in any order of the views. A view has an integer distance d in millimetres. Proper views have a d within the gate.
Their weights are 1 - d / sum d, clamped to [0.3, 0.7], mapped by (w - 0.3) / 0.4 and divided by their sum. At most
three views can have a share d / sum d above 0.3; every other view has the upper clamp. So N, sum d, sum colour and the
three largest (d, colour) suffice, all integers. Without a proper view the view of smallest (d, id) is the fallback.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import Int32Array, IntArray, UInt8Array, UInt16Array
from facade_core.core.numba_cache import njit

# Clamps of the blend weights.
MIN_WEIGHT = 0.3
MAX_WEIGHT = 0.7
# Largest distance that fits 16 bits.
MAX_UINT16_MM = 65_535


class BlendState(NamedTuple):
    """State of `total` texels, updated in place by `add_view`: 33 bytes each.

    A texel without a proper view stores its fallback view in the same arrays: distance is the view's id + 1, or 0
    without any view; top_distance and top_colour hold it first.

    Attributes
    ----------
    views : (t,) uint16 number of proper views.
    distance : (t,) int32 sum of their d, millimetres.
    colour : (t, 3) int32 sum of their colours.
    top_distance : (t, 3) the three largest d, descending.
    top_colour : (t, 3, 3) uint8 their colours.
    """

    views: UInt16Array
    distance: Int32Array
    colour: Int32Array
    top_distance: UInt16Array
    top_colour: UInt8Array

    @classmethod
    def allocate(cls, total: int, *, max_distance_mm: int = MAX_UINT16_MM) -> BlendState:
        """Allocate the state of `total` texels for views up to `max_distance_mm`."""
        return cls(
            views=np.zeros(total, np.uint16),
            distance=np.zeros(total, np.int32),
            colour=np.zeros((total, 3), np.int32),
            top_distance=np.zeros((total, 3), np.uint16 if max_distance_mm <= MAX_UINT16_MM else np.int32),
            top_colour=np.zeros((total, 3, 3), np.uint8),
        )


@njit(cache=True, inline="always")
def is_fallback_view(state: BlendState, t: int, d: int, view: int) -> bool:
    """Return True if a view beyond the gate would become the colour of texel t.

    Called from numba kernels.
    """
    if state.views[t] > 0:
        return False
    fallback_view, nearest = np.int64(state.distance[t]) - 1, np.int64(state.top_distance[t, 0])
    return bool(fallback_view < 0 or d < nearest or (d == nearest and view < fallback_view))


@njit(cache=True, inline="always")
def add_view(state: BlendState, t: int, d: int, proper: bool, view: int, rgb: IntArray) -> None:
    """Add one view of texel t. Called from numba kernels.

    Parameters
    ----------
    state : state of all texels, changed in place.
    t : index of the texel.
    d : distance, millimetres.
    proper : d is within the gate.
    view : id of the viewpoint.
    rgb : (3,) colour.
    """
    n = int(state.views[t])
    if not proper:
        if is_fallback_view(state, t, d, view):
            state.distance[t] = view + 1
            state.top_distance[t, 0] = d
            for c in range(3):
                state.top_colour[t, 0, c] = rgb[c]
        return
    if n == 0:  # drop the fallback view
        state.distance[t] = 0
    state.views[t] = n + 1
    state.distance[t] += d
    for c in range(3):
        state.colour[t, c] += np.int64(rgb[c])
    place = min(n, 3)
    while place > 0 and d > np.int64(state.top_distance[t, place - 1]):
        place -= 1
    if place == 3:
        return
    for k in range(min(n, 2), place, -1):
        state.top_distance[t, k] = state.top_distance[t, k - 1]
        for c in range(3):
            state.top_colour[t, k, c] = state.top_colour[t, k - 1, c]
    state.top_distance[t, place] = d
    for c in range(3):
        state.top_colour[t, place, c] = rgb[c]


def blend_views(state: BlendState) -> tuple[UInt8Array, UInt16Array]:
    """Compute Eq. 1 for all texels.

    Returns
    -------
    Colour (t, 3) uint8, rounded to nearest, and the number of blended views (t,) uint16.
    """
    out = np.zeros((len(state.views), 3), np.uint8)
    views = np.zeros(len(out), np.uint16)
    _blend(state, out, views)
    return out, views


@njit(cache=True, nogil=True)
def _blend(state: BlendState, out: UInt8Array, views: UInt16Array) -> None:
    for t in range(len(out)):
        views[t] = blend_texel(state, t, out)


@njit(cache=True, inline="always")
def blend_texel(state: BlendState, t: int, out: UInt8Array) -> int:
    """Write Eq. 1 of texel t to out[t] and return the number of blended views.

    Called from numba kernels.

    Parameters
    ----------
    state : state of all texels.
    t : index of the texel.
    out : (t, 3) uint8 output colours.
    """
    n = int(state.views[t])
    if n == 0:
        if state.distance[t] == 0:
            return 0
        for c in range(3):
            out[t, c] = state.top_colour[t, 0, c]
        return 1
    if n == 1:
        for c in range(3):
            out[t, c] = state.top_colour[t, 0, c]
        return n
    # all views at the upper clamp (weight 1), then a correction for the largest distances
    total = float(n)
    r, g, b = float(state.colour[t, 0]), float(state.colour[t, 1]), float(state.colour[t, 2])
    if state.distance[t] > 0:
        whole = 1.0 / state.distance[t]
        for k in range(min(n, 3)):
            # weight of the share d / sum d: 1 at the upper clamp, 0 at the lower one
            beyond = min(max(np.int64(state.top_distance[t, k]) * whole, 1.0 - MAX_WEIGHT), 1.0 - MIN_WEIGHT) - (
                1.0 - MAX_WEIGHT
            )
            change = -1.0 / (MAX_WEIGHT - MIN_WEIGHT) * beyond
            total += change
            r += change * state.top_colour[t, k, 0]
            g += change * state.top_colour[t, k, 1]
            b += change * state.top_colour[t, k, 2]
    scale = 1.0 / total
    out[t, 0] = int(min(max(r * scale, 0.0), 255.0) + 0.5)
    out[t, 1] = int(min(max(g * scale, 0.0), 255.0) + 0.5)
    out[t, 2] = int(min(max(b * scale, 0.0), 255.0) + 0.5)
    return n
