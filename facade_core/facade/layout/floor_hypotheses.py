"""Hypotheses of hidden rows and columns: floors extrapolated as in the database, and lines at other pitches."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.core.arrays import Float64Array

# Most lines added between two observed lines, or beyond the last.
_MAX_LINES = 64


def extrapolate_floors(
    floors: Float64Array, heights: Float64Array, progression: Float64Array, low: float, high: float
) -> Float64Array:
    """Extrapolate floors below and above the observed ones.

    Parameters
    ----------
    floors : (F,) centres of at least two observed floors, top to bottom.
    heights : (F,) their window heights.
    progression : (4,) first and later step in observed pitches, height of the first and of later windows in observed
        heights, as training measures them. Upward steps use the inverse: floors that grow downwards
        shrink upwards.
    low, high : y extent of the domain.

    Returns
    -------
    (rows, 2) centres and heights.
    """
    pitch, height = float(np.median(np.diff(floors))), float(np.median(heights))
    found = []
    for sign, start, end in ((1, floors[-1], high), (-1, floors[0], low)):
        first, later, tall, taller = progression if sign > 0 else 1 / progression
        at = start
        for k in range(_MAX_LINES):
            at = at + sign * pitch * (later if k else first)
            own = height * (taller if k else tall)
            if sign * (at - end) + own / 2 > 0:
                break
            found.append((at, own))
    return np.array(found).reshape(-1, 2)


def resample_lines(
    lines: Sequence[float] | Float64Array, pitch: float, size: float, low: float, high: float
) -> Float64Array:
    """Divide every gap into the whole number of steps nearest to `pitch` and extend both ends.

    Parameters
    ----------
    lines : ascending centres.
    pitch : wanted distance between lines.
    size : extent of an element on a line; it must fit into [low, high].
    low, high : extent of the domain along this axis.

    Returns
    -------
    (K,) ascending centres.
    """
    found: list[float] = []
    for a, b in zip(lines[:-1], lines[1:], strict=True):
        steps = min(max(1, round((b - a) / pitch)), _MAX_LINES)
        found += np.linspace(a, b, steps + 1)[:-1].tolist()
    below = min(int((high - size / 2 - lines[-1]) / pitch), _MAX_LINES)
    above = min(int((lines[0] - low - size / 2) / pitch), _MAX_LINES)
    found += [float(lines[-1]) + pitch * k for k in range(max(below, 0) + 1)]
    return np.array([float(lines[0]) - pitch * k for k in range(max(above, 0), 0, -1)] + found)
