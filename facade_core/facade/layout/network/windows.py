"""Windows of the hidden part of a facade by the layout network, which sees the whole layout."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, Int64Array
from facade_core.core.fixed_order import multiply_matrices
from facade_core.core.labels import ELEMENT_CLASSES
from facade_core.core.model_file import file_stamps, open_inference_session, read_model_record
from facade_core.core.types import Element
from facade_core.facade.layout.facade_frame import Rectangle
from facade_core.facade.layout.grids import box_array
from facade_core.facade.layout.network.raster import (
    RASTER,
    STRIDE,
    decode_boxes,
    draw_inputs,
    draw_region,
    fit_pixel_scale,
)
from facade_core.facade.layout.rectangles import WINDOW, pairwise_iou

# Raw output, (classes, 5, rows / 2, columns / 2), of a layout's channels, (1, CHANNELS, rows, columns).
Predict = Callable[[Float32Array], Float32Array]

# Least probability of a window.
MIN_WINDOW_PROBABILITY = 0.25
# Least probability of the window of one cell.
_MIN_CELL_PROBABILITY = 0.03
# Boxes that overlap by this IoU are the same window, as training counts it.
_EQUAL_IOU = 0.5
# Least width and height of a seen window on the raster, in pixels.
_MIN_WINDOW_PIXELS = 4.0
# Boxes that overlap by this IoU are one window.
_SAME_IOU = 0.15
# A proposal of this probability takes the place of a window of the network from this IoU on: its edges are exact where
# the facade is regular.
_MIN_PROPOSAL_PROBABILITY = 0.5
_PROPOSAL_IOU = 0.5
# Smallest side of a window, in pixels.
_MIN_SIDE = 0.2


@dataclass(frozen=True, slots=True, eq=False)
class NetworkWindows:
    """Windows that a network finds in the hidden part.

    Attributes
    ----------
    box : (N, 4) x0, y0, x1, y1 in the unit of the facade, likeliest first.
    probability : (N,) probability of each.
    """

    box: Float64Array
    probability: Float64Array


def load_layout_network(path: Path) -> Predict:
    """Load a layout network once for each version of its files.

    Raises
    ------
    ModelError
        Where a file is missing, the checksum differs, or onnxruntime rejects the network.
    """
    return _load_version(path, file_stamps(path))


@lru_cache(maxsize=2)
def _load_version(path: Path, _stamps: tuple[tuple[int, int], ...]) -> Predict:
    # One thread: results do not depend on the number of cores.
    session = open_inference_session(path, read_model_record(path), threads=1)

    def predict(layout: Float32Array) -> Float32Array:
        raw: Float32Array = np.asarray(session.run(["raw"], {"layout": layout})[0], np.float32)[0]
        return raw

    return predict


def find_network_windows(
    seen: Sequence[Element], domain: Rectangle, region: Float64Array, predict: Predict
) -> NetworkWindows | None:
    """Find windows in the hidden part of a facade, by the facade and its mirror image.

    Parameters
    ----------
    seen : observed elements of ELEMENT_CLASSES.
    domain : (x0, y0, x1, y1) of the facade.
    region : (M, 4) visible boxes.
    predict : the network.

    Returns
    -------
    None where no window is seen, or seen ones are too small on the network's raster.
    """
    scale = fit_pixel_scale(seen, domain)
    windows = box_array([e for e in seen if e.label == "window"])
    if not len(windows) or (np.median(windows[:, 2:] - windows[:, :2], axis=0) * scale < _MIN_WINDOW_PIXELS).any():
        return None
    to_pixels, origin = np.tile(scale, 2), np.tile(domain[:2], 2)
    extent = ((np.array(domain) - origin) * to_pixels)[2:]
    width = float(extent[0])
    labels = np.array([ELEMENT_CLASSES.index(e.label) for e in seen], int)
    drawn, visible = ((box - origin) * to_pixels for box in (box_array(seen), region))
    cells = _read_cells(labels, drawn, visible, extent, predict)
    box, chance = _read_cells(labels, _mirror(drawn, width), _mirror(visible, width), extent, predict)
    box, chance = _merge_views([cells, (_mirror(box, width), chance)])
    return NetworkWindows(box / to_pixels + origin, chance)


def _read_cells(
    labels: Int64Array, box: Float64Array, region: Float64Array, extent: Float64Array, predict: Predict
) -> tuple[Float64Array, Float64Array]:
    """Return box (N, 4) and probability (N,) of the window of each hidden cell that has a likely one; in pixels."""
    visible = draw_region(region, float(extent[0]))
    raw = predict(_draw_layout(labels, box, extent, visible))[WINDOW].astype(float)
    rows, columns = (np.arange(n // STRIDE, dtype=np.float32) for n in RASTER)
    cells = visible[0].reshape(len(rows), STRIDE, len(columns), STRIDE).mean(axis=(1, 3))
    inside = ((columns + 0.5) * STRIDE < extent[0]) & (((rows + 0.5) * STRIDE)[:, None] < extent[1])
    chance = np.where((cells < 0.5) & inside, 1 / (1 + np.exp(-raw[0])), 0.0).ravel()
    found = decode_boxes(raw[1:], rows, columns).reshape(4, -1).T.clip(0, np.tile(extent, 2))
    kept = (chance >= _MIN_CELL_PROBABILITY) & ((found[:, 2:] - found[:, :2]) > _MIN_SIDE).all(axis=1)
    return found[kept], chance[kept]


def _merge_views(views: Sequence[tuple[Float64Array, Float64Array]]) -> tuple[Float64Array, Float64Array]:
    """Return the distinct windows of the cells of several views, likeliest first.

    The probability of a window is that of the likeliest cell with an equal box, as the mean over views; its box is the
    mean of all equal ones, weighted by their probabilities.
    """
    box, weight = (np.concatenate(part) for part in zip(*views, strict=True))
    equal = [pairwise_iou(box, other) >= _EQUAL_IOU for other, _ in views]
    likeliest = [
        np.where(same, chance, 0.0).max(axis=1, initial=0.0) for same, (_, chance) in zip(equal, views, strict=True)
    ]
    chance = np.mean(likeliest, axis=0)
    index = np.lexsort((-weight, -chance))
    index = index[chance[index] >= MIN_WINDOW_PROBABILITY]
    index = index[_select_distinct(box[index])]
    shares = np.where(np.concatenate(equal, axis=1)[index], weight, 0.0)
    return multiply_matrices(shares, box) / shares.sum(axis=1, keepdims=True), chance[index]


def move_to_proposals(windows: Float64Array, proposals: Float64Array, probability: Float64Array) -> Float64Array:
    """Return windows (N, 4), each as the likeliest of the likely proposals (M, 4) that nearly equal it, if any."""
    likely = probability >= _MIN_PROPOSAL_PROBABILITY
    proposals, probability = proposals[likely], probability[likely]
    if not len(proposals) or not len(windows):
        return windows
    worth = np.where(pairwise_iou(windows, proposals) >= _PROPOSAL_IOU, probability, -np.inf)
    best = worth.argmax(axis=1)
    found = np.isfinite(worth[np.arange(len(windows)), best])
    moved: Float64Array = np.where(found[:, None], proposals[best], windows)
    return moved


def _draw_layout(labels: Int64Array, box: Float64Array, extent: Float64Array, visible: Float32Array) -> Float32Array:
    """Draw the network's input; `box` (N, 4) and `extent` (2,) are in pixels."""
    rows, columns = (np.arange(n, dtype=np.float32) for n in RASTER)
    kinds = np.eye(len(ELEMENT_CLASSES), dtype=np.float32)[labels]
    guessed = np.zeros((1, len(labels), 1), np.float32)
    drawn = draw_inputs(
        box.astype(np.float32)[None], kinds[None], guessed, extent.astype(np.float32)[None], rows, columns
    )
    layout: Float32Array = np.concatenate([*drawn, visible[None]], axis=1).astype(np.float32)
    return layout


def _mirror(box: Float64Array, width: float) -> Float64Array:
    """Return boxes (N, 4) mirrored in a facade of this width."""
    mirrored = box.copy()
    mirrored[:, [0, 2]] = width - box[:, [2, 0]]
    return mirrored


def _select_distinct(box: Float64Array) -> BoolArray:
    """Mark, (N,) bool, the boxes that equal no earlier one."""
    same = pairwise_iou(box, box) > _SAME_IOU
    kept = np.ones(len(box), bool)
    for k in range(len(box)):
        if kept[k]:
            kept[k + 1 :] &= ~same[k, k + 1 :]
    return kept
