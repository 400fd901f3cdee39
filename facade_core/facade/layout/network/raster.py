"""Raster of a partly observed layout, as the layout network sees it: one unit is a usual window.

The functions on batches work on arrays of numpy and of torch alike, so that training and inference draw the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from facade_core.core.arrays import Float32Array, Float64Array
from facade_core.core.labels import ELEMENT_CLASSES
from facade_core.core.types import Element
from facade_core.facade.layout.facade_frame import Rectangle
from facade_core.facade.layout.grids import box_array

# Rows and columns of the raster; the domain begins in its upper left corner.
RASTER = (96, 128)
# Pixels of the raster to an output cell.
STRIDE = 2
# Width and height of a usual window in pixels, less where the facade would not fit.
WINDOW_PIXELS = (6.0, 7.0)
# Width and height of a usual window where none is seen, as shares of the domain.
_USUAL_SHARE = (0.06, 0.1)
CHANNELS = 3 * len(ELEMENT_CLASSES) + 8
# Distances are in this many pixels.
_DISTANCE_UNIT = 32.0
# Elements are drawn whole, and the inner half of each side, which keeps neighbours apart.
_CORE_SHARE = 0.5

Batch = TypeVar("Batch")


def fit_pixel_scale(seen: Sequence[Element], domain: Rectangle) -> Float64Array:
    """Return pixels of the raster per unit of the facade, (2,) horizontal and vertical."""
    extent = np.array([domain[2] - domain[0], domain[3] - domain[1]])
    box = box_array([e for e in seen if e.label == "window"])
    size = np.median(box[:, 2:] - box[:, :2], axis=0) if len(box) else extent * _USUAL_SHARE
    fitting: Float64Array = np.minimum(np.array(WINDOW_PIXELS) / size, np.array(RASTER[::-1]) / extent)
    return fitting


def draw_region(region: Float64Array, width: float) -> Float32Array:
    """Draw visible boxes in pixels and their mirror image in a facade of this width: (2, rows, columns)."""
    rows, columns = (np.arange(n, dtype=np.float32) for n in RASTER)
    mirrored = region.copy()
    mirrored[:, [0, 2]] = width - region[:, [2, 0]]
    both = np.stack([region, mirrored]).astype(np.float32)
    drawn: Float32Array = draw_boxes(both, np.ones((2, len(region), 1), np.float32), rows, columns)[:, 0].clip(0, 1)
    return drawn


def interval_coverage(low, high, cells):  # type: ignore[no-untyped-def]  # arrays of numpy or of torch
    """Return the share of each cell that each interval covers, (..., N, cells)."""
    return (high[..., None] - cells).clip(0, 1) - (low[..., None] - cells).clip(0, 1)


def draw_boxes(box, weight, rows, columns):  # type: ignore[no-untyped-def]
    """Sum the covered shares of pixels, (..., C, rows, columns), over boxes (..., N, 4) of weights (..., N, C)."""
    x = interval_coverage(box[..., 0], box[..., 2], columns)
    y = interval_coverage(box[..., 1], box[..., 3], rows)
    weighted = y[..., None, :, :] * weight.swapaxes(-1, -2)[..., None]
    return weighted.swapaxes(-1, -2) @ x[..., None, :, :]


def draw_inputs(box, kinds, guessed, extent, rows, columns):  # type: ignore[no-untyped-def]
    """Return the channels that elements and coordinates make, as a list of (B, C, rows, columns).

    Parameters
    ----------
    box : (B, N, 4) known elements in pixels.
    kinds : (B, N, LABEL_COUNT) one for the label of a known element, else zero.
    guessed : (B, N, 1) one for elements that an earlier round chose.
    extent : (B, 2) width and height of the domain in pixels.
    rows, columns : indices of the raster's pixels.
    """
    half = (box[..., 2:] - box[..., :2]) * (_CORE_SHARE / 2)
    middle = (box[..., 2:] + box[..., :2]) / 2
    core = 0 * box
    core[..., :2], core[..., 2:] = middle - half, middle + half
    mirrored = 1 * box
    mirrored[..., 0], mirrored[..., 2] = extent[:, :1] - box[..., 2], extent[:, :1] - box[..., 0]
    domain = (
        interval_coverage(0 * extent[:, 1:], extent[:, 1:], rows)[:, :, :, None]
        * interval_coverage(0 * extent[:, :1], extent[:, :1], columns)[:, :, None, :]
    )
    x, y = (columns + 0.5)[None, None, None, :], (rows + 0.5)[None, None, :, None]
    width, height = extent[:, :1, None, None], extent[:, 1:, None, None]
    return [
        draw_boxes(box, kinds, rows, columns),
        draw_boxes(core, kinds, rows, columns),
        draw_boxes(mirrored, kinds, rows, columns),
        draw_boxes(box, guessed, rows, columns),
        domain,
        *(domain * distance / _DISTANCE_UNIT for distance in (x, width - x, y, height - y)),
    ]


def decode_boxes(raw, rows, columns):  # type: ignore[no-untyped-def]
    """Return boxes in pixels, corners in the third axis from the end, of the network's output.

    Parameters
    ----------
    raw : (..., 4, rows, columns) shift of the centre in window sizes, logarithm of the size in window sizes.
    rows, columns : indices of the output cells.
    """
    wide, tall = WINDOW_PIXELS
    x = (columns + 0.5)[None, :] * STRIDE + raw[..., 0, :, :] * wide
    y = (rows + 0.5)[:, None] * STRIDE + raw[..., 1, :, :] * tall
    half = (raw[..., 2:, :, :].clip(-4, 4)).exp() if hasattr(raw, "exp") else np.exp(raw[..., 2:, :, :].clip(-4, 4))
    w, h = half[..., 0, :, :] * (wide / 2), half[..., 1, :, :] * (tall / 2)
    out = 0 * raw
    out[..., 0, :, :], out[..., 1, :, :], out[..., 2, :, :], out[..., 3, :, :] = x - w, y - h, x + w, y + h
    return out
