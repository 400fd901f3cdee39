"""Where rows and columns may stand that nothing shows: floors carried on as those of the database go on, and holes filled."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

# No facade has more rows or columns between two that are seen, or beyond the last.
_MAX_LINES = 64


def extrapolate_floors(floors: np.ndarray, heights: np.ndarray, progression: np.ndarray, low: float, high: float) -> np.ndarray:
    """(rows, 2) centres and heights of floors below, and above, those seen.

    floors, heights (F,) of those seen, from top to bottom, at least two; how (4,): the first step, every later one, both in
    pitches seen, and the height of the first window and of later ones in heights seen, as `floor_progressions` learns them; low,
    high: the domain. Steps upwards are the inverse: storeys that grow downwards shrink upwards.
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


def floor_progressions(floors: np.ndarray, heights: np.ndarray) -> list[tuple[float, ...]]:
    """How a whole facade's floors go on below each of its floors but the first: logarithms of what `extrapolate_floors` takes."""
    found = []
    for k in range(2, len(floors)):
        pitch, height = np.median(np.diff(floors[:k])), np.median(heights[:k])
        steps, tall = np.diff(floors[k - 1 :]) / pitch, heights[k:] / height
        later = np.median(steps[1:]) if len(steps) > 1 else steps[0]
        row = (steps[0], later, tall[0], np.median(tall[1:]) if len(tall) > 1 else tall[0])
        found.append(tuple(np.log(row).tolist()))
    return found


def resample_lines(lines: Sequence[float] | np.ndarray, pitch: float, size: float, low: float, high: float) -> np.ndarray:
    """Lines with every gap divided into the whole number of steps nearest to `pitch`, and both ends carried on by it as far as
    elements of `size` fit into [low, high]."""
    found: list[float] = []
    for a, b in zip(lines[:-1], lines[1:], strict=True):
        steps = min(max(1, round((b - a) / pitch)), _MAX_LINES)
        found += np.linspace(a, b, steps + 1)[:-1].tolist()
    below = min(int((high - size / 2 - lines[-1]) / pitch), _MAX_LINES)
    above = min(int((lines[0] - low - size / 2) / pitch), _MAX_LINES)
    found += [float(lines[-1]) + pitch * k for k in range(max(below, 0) + 1)]
    return np.array([float(lines[0]) - pitch * k for k in range(max(above, 0), 0, -1)] + found)
