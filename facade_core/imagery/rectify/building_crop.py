"""Crop of a facade picture to the one building that it was taken for, without sky, street and neighbours."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.imagery.rectify.crop import FacadeCrop, crop_to_box, find_facade_box
from facade_core.imagery.rectify.neighbours import choose_sides, measure_gaps
from facade_core.imagery.rectify.photo_state import check_photo_state
from facade_core.parsing.segmenter import (
    ParserModel,
    Surroundings,
    classify_surroundings,
    crop_segmentation,
    segment_picture,
    segment_surroundings,
)


def crop_to_facade(image: UInt8Array, hidden: BoolArray, *, model: ParserModel = None) -> FacadeCrop:
    """Crop the picture of an exemplar to the facade in its middle, without sky, street and neighbours.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    hidden : (H, W) bool, pixels that do not show the facade.
    model : as in `parse`.
    """
    if hidden.all():
        return crop_to_box(image, hidden, np.zeros_like(hidden), None)
    seen = segment_surroundings(image, hidden, model=model)
    return _crop_to_sides(image, hidden, seen, image.shape[1] / 2, None)


def crop_to_building(
    image: UInt8Array,
    hidden: BoolArray,
    centre: float,
    aspect: float | None,
    *,
    is_day: bool,
    model: ParserModel = None,
) -> FacadeCrop:
    """Crop a rectified photo to the facade of one building.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    hidden : (H, W) bool, pixels that do not show the facade.
    centre : column that the photo was pointed at.
    aspect : width over height of the wall; None if unknown.
    is_day : whether the whole photo, before it was rectified, shows that it was taken by day.
    model : as in `parse`.

    Raises
    ------
    ImageError : it is upside down, or was taken at night.
    """
    if hidden.all():
        return crop_to_box(image, hidden, np.zeros_like(hidden), None)
    segmentation = segment_picture(image, hidden, model=model)
    seen = classify_surroundings(segmentation, hidden)
    check_photo_state(image, hidden, seen, is_day)
    cut = _crop_to_sides(image, hidden, seen, centre, aspect)
    return replace(cut, segmentation=crop_segmentation(segmentation, cut.box, hidden.shape))


def _crop_to_sides(
    image: UInt8Array, hidden: BoolArray, seen: Surroundings, centre: float, aspect: float | None
) -> FacadeCrop:
    """Cut off sky, street and the neighbours beyond the party walls."""
    outside, labels = seen
    box = find_facade_box(outside, hidden)
    if box is None:
        return crop_to_box(image, hidden, outside, None)
    x0, y0, x1, y1 = box
    part = np.s_[y0:y1, x0:x1]
    gaps = measure_gaps(image[part], labels[part], (outside | hidden)[part])
    left, right = choose_sides(gaps, (y1 - y0, x1 - x0), centre - x0, aspect, 1 - hidden[part].mean(axis=0))
    sides = [name for name, cut in (("left", left > 0), ("right", right < x1 - x0)) if cut]
    if sides:
        # the neighbours may have had the more sky or street
        inner = np.s_[:, x0 + left : x0 + right]
        x0, x1 = x0 + left, x0 + right
        cut = find_facade_box(outside[inner], hidden[inner])
        if cut is not None:
            y0, y1 = cut[1], cut[3]
    found = crop_to_box(image, hidden, outside, (x0, y0, x1, y1))
    return replace(found, notes=(f"neighbour on the {' and '.join(sides)} cut off",)) if sides else found
