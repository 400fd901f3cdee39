"""A picture of a facade, cut to the facade: sky above it, the street before it and neighbours beside it are no wall."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from facade_core.parse.segmenter import seen_outside

# A facade that is less than this share of its picture is not believed: the picture stays whole.
LEAST = 0.25
# Turns in which rows and columns are chosen; each leaves the box as it is or makes it better, and few are ever needed.
TURNS = 4

Box = tuple[int, int, int, int]


@dataclass(frozen=True, slots=True, eq=False)
class Cut:
    """The part of a picture that is the facade: image (h, w, 3) uint8; hidden (h, w) bool, what does not show it; outside
    (h, w) bool, what shows sky, street or neighbours at its borders; box (x0, y0, x1, y1) of it in the picture, half-open."""

    image: np.ndarray
    hidden: np.ndarray
    outside: np.ndarray
    box: Box


def cut_to_facade(image: np.ndarray, hidden: np.ndarray) -> Cut:
    """A picture (H, W, 3) uint8, of which hidden (H, W) bool does not show the facade, cut to it. Raises ImageError where
    all is hidden."""
    outside = seen_outside(np.dstack([image, np.where(hidden, 0, 255).astype(np.uint8)]))
    x0, y0, x1, y1 = box = facade_box(outside, hidden)
    beyond = outside[y0:y1, x0:x1]
    if (y1 - y0) * (x1 - x0) == outside.size and beyond.mean() > 1 - LEAST:
        # Next to nothing of the picture is told to be a facade: that is no better told of its pixels.
        beyond = np.zeros_like(beyond)
    return Cut(image[y0:y1, x0:x1], hidden[y0:y1, x0:x1], _from_border(beyond), box)


def facade_box(outside: np.ndarray, hidden: np.ndarray) -> Box:
    """The box (x0, y0, x1, y1) with the most pixels of the facade over those outside (H, W) bool; hidden ones count for
    neither, and stay where they may. The whole where the box would be less than LEAST of it.

    Rows are chosen within the columns and columns within the rows, by turns.
    """
    value = np.where(hidden, 0, np.where(outside, -1, 1))
    height, width = value.shape
    rows, columns = (0, height), (0, width)
    for _ in range(TURNS):
        rows = _greatest_run(value[:, slice(*columns)].sum(1))
        columns = _greatest_run(value[slice(*rows)].sum(0))
    if (rows[1] - rows[0]) * (columns[1] - columns[0]) < LEAST * value.size:
        return 0, 0, width, height
    return columns[0], rows[0], columns[1], rows[1]


def _greatest_run(values: np.ndarray) -> tuple[int, int]:
    """The run (start, stop) of the greatest sum; of those that are equal the longest, of these the first."""
    sums = np.concatenate([[0], np.cumsum(values)])
    lowest = np.minimum.accumulate(sums)
    best = (sums - lowest).max()
    stops = np.flatnonzero(sums - lowest == best)
    # The first place where the sum was as low as it ever was before each stop.
    starts = np.searchsorted(-lowest, -lowest[stops])
    longest = int(np.argmax(stops - starts))
    return int(starts[longest]), int(stops[longest])


def _from_border(outside: np.ndarray) -> np.ndarray:
    """The parts that reach the border: what is taken for sky inside a facade is a pane or a gap in a balcony."""
    parts, _ = ndimage.label(outside)
    edge = np.concatenate([parts[0], parts[-1], parts[:, 0], parts[:, -1]])
    return np.isin(parts, np.unique(edge[edge > 0]))
