"""How far the ground is from the nearest centreline, at a cost that does not grow with the number of streets."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from numba import njit

from facade_core.types import Street

# Cells of the grid by which segments are found: this wide at least, metres, and so many at most.
CELL_M, CELLS = 8.0, 1 << 20


class Lines(NamedTuple):
    """Segments on a grid, as kernels read them.

    low (2,): the grid's corner, metres;
    cell: a cell's side, metres;
    shape (2,): cells across and up;
    start (cells + 1,): where each cell's members begin;
    member (m,): segments;
    segments (k, 4): x0, y0, x1, y1;
    reach: metres.
    """

    low: np.ndarray
    cell: float
    shape: np.ndarray
    start: np.ndarray
    member: np.ndarray
    segments: np.ndarray
    reach: float


class Centrelines:
    """The segments of all centrelines on a grid: a cell lists those that come within `reach` metres of it."""

    def __init__(self, streets: Sequence[Street], reach: float) -> None:
        self._reach = reach
        self._segments = _segments(streets)
        low, high = np.zeros(2), np.zeros(2)
        if len(self._segments):
            ends = self._segments.reshape(-1, 2)
            low, high = ends.min(axis=0) - reach, ends.max(axis=0) + reach
        self._low, self._cell = low, max(CELL_M, float(np.sqrt(np.prod(high - low) / CELLS)))
        self._shape = np.floor((high - low) / self._cell).astype(np.int64) + 1
        cell, self._member = self._cells().T
        self._start = np.searchsorted(cell, np.arange(np.prod(self._shape) + 1))

    def distance(self, points: np.ndarray) -> np.ndarray:
        """How far points (n, 2) are from the nearest centreline, metres, (n,); inf beyond the reach."""
        found = np.empty(len(points))
        distances(np.ascontiguousarray(points[:, 0]), np.ascontiguousarray(points[:, 1]), self.lines, found)
        return found

    @property
    def lines(self) -> Lines:
        """What `distances` asks."""
        return Lines(self._low, self._cell, self._shape, self._start, self._member, self._segments, self._reach)

    def _cells(self) -> np.ndarray:
        """Pairs (k, 2) of a cell and a segment within reach of it, sorted: by the boxes of pieces no longer than a cell."""
        begin, along = self._segments[:, :2], self._segments[:, 2:] - self._segments[:, :2]
        pieces = np.maximum(np.ceil(np.hypot(*along.T) / self._cell), 1).astype(np.int64)
        segment = np.repeat(np.arange(len(pieces)), pieces)
        step = np.arange(len(segment)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
        ends = [begin[segment] + along[segment] * ((step + k) / pieces[segment])[:, None] for k in (0, 1)]
        first, last = (
            np.clip(np.floor((corner - self._low) / self._cell).astype(np.int64), 0, self._shape - 1)
            for corner in (np.minimum(*ends) - self._reach, np.maximum(*ends) + self._reach)
        )
        most = (last - first).max(axis=0, initial=0) + 1
        pairs = []
        for offset in np.ndindex(*most):
            met = (first + np.array(offset) <= last).all(axis=1)
            column, row = (first[met] + np.array(offset)).T
            pairs.append(np.column_stack([row * self._shape[0] + column, segment[met]]))
        return np.unique(np.concatenate(pairs), axis=0)


def _segments(streets: Sequence[Street]) -> np.ndarray:
    """The segments (k, 4) of all centrelines, x0, y0, x1, y1, cut where they cross."""
    lines = shapely.get_parts(shapely.union_all([street.line for street in streets]))
    corners, line = shapely.get_coordinates(lines, return_index=True)
    same = line[1:] == line[:-1]
    return np.column_stack([corners[:-1][same], corners[1:][same]])


@njit(cache=True, nogil=True)
def distances(x: np.ndarray, y: np.ndarray, lines: Lines, out: np.ndarray) -> None:
    """How far places (n,) are from the nearest centreline, metres, inf beyond the reach, into out (n,).

    As GEOS computes it, in the order of its operations: the bits are those of shapely.distance.
    """
    low_x, low_y, cell, wide, high = lines.low[0], lines.low[1], lines.cell, lines.shape[0], lines.shape[1]
    start, member, segments, reach = lines.start, lines.member, lines.segments, lines.reach
    for i in range(len(x)):
        column, row = np.floor((x[i] - low_x) / cell), np.floor((y[i] - low_y) / cell)
        nearest = np.inf
        if 0 <= column < wide and 0 <= row < high:
            here = int(row) * wide + int(column)
            for k in range(start[here], start[here + 1]):
                m = member[k]
                ax, ay, bx, by = segments[m, 0], segments[m, 1], segments[m, 2], segments[m, 3]
                dx, dy = bx - ax, by - ay
                square = dx * dx + dy * dy
                along = ((x[i] - ax) * dx + (y[i] - ay) * dy) / square if square > 0 else 0.0
                if along <= 0:
                    away = np.sqrt((x[i] - ax) * (x[i] - ax) + (y[i] - ay) * (y[i] - ay))
                elif along >= 1:
                    away = np.sqrt((x[i] - bx) * (x[i] - bx) + (y[i] - by) * (y[i] - by))
                else:
                    away = np.abs(((ay - y[i]) * dx - (ax - x[i]) * dy) / square) * np.sqrt(square)
                nearest = min(nearest, away)
        out[i] = nearest if nearest <= reach else np.inf
