"""Irregular rectangular lattice of a label map (tiles paper, section 3.1, Algo. 1)."""

from __future__ import annotations

import math

import numpy as np

from facade_core.core.arrays import Int64Array, UInt8Array
from facade_core.core.errors import LayoutError
from facade_core.core.types import Lattice
from facade_core.parsing.validation import check_labels


def lattice(labels: UInt8Array, *, max_lines: int = 40, eta: float = 0.02) -> Lattice:
    """Choose split lines greedily along strong, well-spread label edges (Algo. 1 of the tiles paper).

    Row position h is between the pixel rows h - 1 and h; the borders 0 and H (0 and W) are always included. The score
    of a position is the share of pixels whose label changes across it (Eq. 1) times the distance in pixels to the
    nearest line (Eq. 2, read as min), recomputed after each insertion (Eq. 3). Ties go to rows, then to the smaller
    position. A map without a label edge has its borders only.

    Parameters
    ----------
    labels : (H, W) uint8 class ids or UNKNOWN, which counts as a label of its own.
    max_lines : rows and columns at most, including borders.
    eta : stop when the best score is at most this share of the first line's score.

    Raises
    ------
    ImageError
        If the label map cannot be used.
    LayoutError
        If max_lines < 4 or eta is outside [0, 1].
    """
    check_labels(labels)
    if max_lines < 4:
        raise LayoutError(f"max_lines {max_lines} is less than the four borders; give at least 4")
    if not (math.isfinite(eta) and 0 <= eta <= 1):
        raise LayoutError(f"eta {eta} is no share of the first line's score; give a value in [0, 1]")
    height, width = labels.shape
    # Scores are kept as integers, multiplied by H * W, so that ties are exact.
    row_edges = np.count_nonzero(labels[:-1] != labels[1:], axis=1) * height
    column_edges = np.count_nonzero(labels[:, :-1] != labels[:, 1:], axis=0) * width
    row_distance, column_distance = _border_distance(height), _border_distance(width)
    rows, columns = [0, height], [0, width]
    row, row_score = _best_position(row_edges * row_distance)
    column, column_score = _best_position(column_edges * column_distance)
    min_score = eta * max(row_score, column_score)
    while len(rows) + len(columns) < max_lines and max(row_score, column_score) > min_score:
        if row_score >= column_score:
            rows.append(row)
            row_distance = _nearest_distance(row_distance, row)
            row, row_score = _best_position(row_edges * row_distance)
        else:
            columns.append(column)
            column_distance = _nearest_distance(column_distance, column)
            column, column_score = _best_position(column_edges * column_distance)
    return Lattice(tuple(sorted(rows)), tuple(sorted(columns)))


def _border_distance(length: int) -> Int64Array:
    """Distance of the inner positions 1 .. length - 1 to the nearer border."""
    position = np.arange(1, length)
    return np.minimum(position, length - position)


def _nearest_distance(distance: Int64Array, line: int) -> Int64Array:
    return np.minimum(distance, np.abs(np.arange(1, len(distance) + 1) - line))


def _best_position(scores: Int64Array) -> tuple[int, int]:
    """Position of the highest score, the first of equals, and that score; (0, 0) without positions."""
    if not scores.size:
        return 0, 0
    index = int(scores.argmax())
    return index + 1, int(scores[index])
