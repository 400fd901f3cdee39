"""What is visible of a facade's picture, as completion of its layout takes it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.core.types import Element

# A window cut by a hole's border reaches so far out of it, as a share of its side.
_WINDOW_REACH = 0.5
# Cells of the longer side in which the visible part of a picture is told.
_MAX_CELLS = 128


def visible_boxes(hidden: np.ndarray) -> list[tuple[float, float, float, float]]:
    """The visible part of a facade as boxes (x0, y0, x1, y1) that do not overlap: the runs of its rows, those that go on
    unchanged joined. Where the picture is large a cell of several pixels counts as hidden when any of it is, so that there are
    at most some thousand boxes and none reaches into a hole."""
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


def dilate_by_window(hidden: np.ndarray, observed: Sequence[Element]) -> np.ndarray:
    """What is hidden, (h, w) bool, and as far around it as a window cut by its border reaches: half a window of those observed.
    Whether one stands there is told by the picture (`complete`, evidence)."""
    from scipy.ndimage import maximum_filter

    size = np.array([(e.height, e.width) for e in observed if e.label == "window"]).reshape(-1, 2)
    if not len(size):
        return hidden
    return maximum_filter(hidden, tuple((np.median(size, axis=0) * _WINDOW_REACH).astype(int) * 2 + 1))
