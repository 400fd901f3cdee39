"""Metric scale of an exemplar from the height of its floors."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Float64Array, UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.labels import FacadeClass
from facade_core.facade.texture.settings import PICTURES
from facade_core.facade.texture.validation import check_exemplar_image, check_exemplar_labels
from facade_core.parsing.floor_structure import window_row_spans


def exemplar_scale(image: UInt8Array, labels: UInt8Array, *, storey: float = 3.2) -> float:
    """Estimate the metres per pixel of an exemplar.

    Two or more rows of windows: floor height over the median spacing of their middles. One row: a door has
    `door_height_m` metres, else the windows have `window_share` of a floor.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    labels : (H, W) uint8 class ids.
    storey : floor height, metres.

    Raises
    ------
    ImageError
        If there is neither a window nor a door.
    """
    check_exemplar_image(image)
    check_exemplar_labels(image, labels)
    if not storey > 0:
        raise ImageError(f"exemplar_scale: storey is {storey}; pass a height in metres above 0")
    spans = window_row_spans(labels == FacadeClass.WINDOW)
    middles = np.array([(a + b) / 2 for a, b in spans])
    if len(middles) >= 2:
        return storey / _typical_spacing(np.diff(middles))
    door = (labels == FacadeClass.DOOR).any(1).sum()
    if door:
        return PICTURES.door_height_m / float(door)
    if len(spans) == 1:
        return PICTURES.window_share * storey / float(spans[0][1] - spans[0][0])
    raise ImageError("exemplar_scale: the labels show neither windows nor a door; label the exemplar or give its scale")


def _typical_spacing(spacings: Float64Array) -> float:
    """Return the median spacing; spacings near a multiple of it (a missed row) count as several."""
    median = np.median(spacings)
    return float(np.median(spacings / np.maximum(1, np.rint(spacings / median))))
