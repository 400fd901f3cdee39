"""Visible region of a facade's picture, as layout completion takes it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array
from facade_core.core.types import Element
from facade_core.facade.layout.facade_frame import Rectangle

# Reach of a cut window out of a hole, as a share of its side.
_WINDOW_REACH = 0.5
# Most cells of the longer side of the visible region.
_MAX_CELLS = 128
# A hidden middle: columns hidden whole make up this share of the width, between columns visible for half of the height.
_MIDDLE_SHARE = 0.25
_SIDE_SHARE = 0.5
# Cells of a side for that.
_MIDDLE_CELLS = 48


def visible_region_boxes(hidden: BoolArray) -> list[tuple[float, float, float, float]]:
    """Cover the visible part of a facade with disjoint boxes.

    Boxes are runs of rows; unchanged runs of neighbouring rows are joined. Large pictures are reduced to cells of
    several pixels, and a cell is hidden if any of its pixels is: at most some thousand boxes result, and none reaches
    into a hole.

    Parameters
    ----------
    hidden : (H, W) bool.

    Returns
    -------
    (x0, y0, x1, y1) boxes in pixels.
    """
    height, width = hidden.shape
    cell = max(1, max(height, width) // _MAX_CELLS)
    rows, columns = -(-height // cell), -(-width // cell)
    padded = np.pad(hidden, ((0, rows * cell - height), (0, columns * cell - width)), mode="edge")
    visible = ~padded.reshape(rows, cell, columns, cell).any(axis=(1, 3))
    edges = np.diff(np.pad(visible, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    boxes: list[tuple[float, float, float, float]] = []
    going_on: dict[tuple[int, int], int] = {}
    for y in range(rows + 1):
        runs: dict[tuple[int, int], int] = {}
        if y < rows:
            ends = zip(np.flatnonzero(edges[y] == 1).tolist(), np.flatnonzero(edges[y] == -1).tolist(), strict=True)
            runs = {run: going_on.get(run, y) for run in ends}
        for (x0, x1), since in going_on.items():
            if (x0, x1) not in runs:
                corner = min(x1 * cell, width), min(y * cell, height)
                boxes.append((float(x0 * cell), float(since * cell), float(corner[0]), float(corner[1])))
        going_on = runs
    return boxes


def dilate_hidden_by_window(hidden: BoolArray, observed: Sequence[Element]) -> BoolArray:
    """Dilate the hidden region by half an observed window.

    A window that the border of the hole cuts may reach so far out of it. The picture decides whether there is one
    (`complete`, evidence).

    Parameters
    ----------
    hidden : (h, w) bool.
    observed : elements; without windows the region stays as it is.

    Returns
    -------
    (h, w) bool.
    """
    from scipy.ndimage import maximum_filter

    size = np.array([(e.height, e.width) for e in observed if e.label == "window"]).reshape(-1, 2)
    if not len(size):
        return hidden
    dilated: BoolArray = maximum_filter(hidden, tuple((np.median(size, axis=0) * _WINDOW_REACH).astype(int) * 2 + 1))
    return dilated


def is_middle_hidden(region: Float64Array, domain: Rectangle) -> bool:
    """Tell whether a wide strip is hidden from top to bottom between two visible parts.

    Parameters
    ----------
    region : (M, 4) visible boxes.
    domain : (x0, y0, x1, y1) of the facade.
    """
    share = (np.arange(_MIDDLE_CELLS) + 0.5) / _MIDDLE_CELLS
    x, y = (domain[k] + share * (domain[k + 2] - domain[k]) for k in (0, 1))
    across = (region[:, :1] <= x) & (x < region[:, 2:3])
    upright = (region[:, 1:2] <= y) & (y < region[:, 3:])
    visible = (upright[:, :, None] & across[:, None]).any(axis=0).mean(axis=0)
    sides = np.flatnonzero(visible >= _SIDE_SHARE)
    if not len(sides):
        return False
    return bool((visible[sides[0] : sides[-1]] == 0).sum() >= _MIDDLE_SHARE * _MIDDLE_CELLS)
