"""Trimming of a rectified picture to the one facade that it shows: no neighbours, no sky, no bays that are cut off."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from facade_core.core.arrays import UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.core.types import Box, Parsing
from facade_core.facade.evidence import Evidence
from facade_core.facade.neighbour_removal import find_clean_columns, find_own_columns
from facade_core.facade.sky_removal import count_sky_rows
from facade_core.parsing.elements import elements
from facade_core.parsing.floor_structure import (
    FloorsAndBays,
    fill_sky_and_unknown,
    find_floors_and_bays,
    spans_above_threshold,
)

# A window that begins within this share of the width from a side is cut off by it.
SIDE_MARGIN_SHARE = 0.012
# Share of a column that windows and doors may take where a cut avoids them.
MAX_CUT_SHARE = 0.02


def trim_to_facade(photo: Evidence) -> tuple[Evidence, Box]:
    """Trim an observed picture to its facade.

    Bays and floors that the picture cuts through, neighbours, sky above the eaves, and what stands at the sides go.

    Parameters
    ----------
    photo : the observed picture.

    Returns
    -------
    What remains, and its box in the picture.
    """
    box = (0, 0, 0, 0)
    for find_part in (_whole_part, _own_part, _part_below_sky, _part_of_clean_sides, _part_of_whole_openings):
        y0, y1, x0, x1 = find_part(photo)
        left, top = box[0] + x0, box[1] + y0
        box = (left, top, left + x1 - x0, top + y1 - y0)
        photo = cut_picture_part(photo, (y0, y1, x0, x1))
    return photo, box


def cut_picture_part(photo: Evidence, bounds: tuple[int, int, int, int]) -> Evidence:
    """Cut a picture and its parse to rows and columns."""
    y0, y1, x0, x1 = bounds
    part = np.s_[y0:y1, x0:x1]
    hidden = photo.hidden[part]
    if hidden.shape == photo.hidden.shape:
        return photo
    parsing = Parsing(photo.parsing.labels[part], photo.parsing.confidence[part], photo.parsing.occluded[part])
    observed = tuple(elements(replace(parsing, occluded=hidden)))
    image = np.ascontiguousarray(photo.image[part])
    cut = replace(photo, image=image, parsed=parsing, hidden=hidden, elements=observed, masked=())
    return replace(cut, outside=photo.surroundings[part], segmentation=None)


def _whole_part(photo: Evidence) -> tuple[int, int, int, int]:
    """Rows and columns without the bays and the top floor that the borders cut through."""
    labels = photo.parsing.labels
    height, width = labels.shape
    structure = find_floors_and_bays(fill_sky_and_unknown(labels))
    if structure is None:
        return 0, height, 0, width
    margin = SIDE_MARGIN_SHARE * width
    window = labels == FacadeClass.WINDOW
    x0, x1 = _whole_columns(structure, margin, width)
    top = window[: max(2, round(margin)), x0:x1].any(axis=0).mean()
    y0 = structure.floor_cuts[1] if top > 0.1 and len(structure.floors) > 1 else 0
    return y0, height, x0, x1


def _own_part(photo: Evidence) -> tuple[int, int, int, int]:
    """Rows and columns without the neighbours."""
    labels = fill_sky_and_unknown(photo.parsing.labels)
    return 0, len(labels), *find_own_columns(photo.image, labels, photo.hidden, photo.surroundings)


def _part_below_sky(photo: Evidence) -> tuple[int, int, int, int]:
    """Rows and columns without sky above the eaves."""
    labels = fill_sky_and_unknown(photo.parsing.labels)
    return count_sky_rows(photo.image, labels, photo.hidden, photo.surroundings), len(labels), 0, labels.shape[1]


def _part_of_clean_sides(photo: Evidence) -> tuple[int, int, int, int]:
    """Rows and columns without lamps, pipes and neighbours' roofs at the sides."""
    labels = fill_sky_and_unknown(photo.parsing.labels)
    return 0, len(labels), *find_clean_columns(photo.image, labels)


def _whole_columns(structure: FloorsAndBays, margin: float, width: int) -> tuple[int, int]:
    """Columns without the first and last bay where the side of the picture cuts through its windows."""
    x0 = structure.bay_cuts[1] if structure.bays[0][0] <= margin and len(structure.bays) > 1 else 0
    x1 = structure.bay_cuts[-2] if structure.bays[-1][1] >= width - margin and len(structure.bays) > 1 else width
    return (x0, x1) if x1 > x0 else (0, width)


def _part_of_whole_openings(photo: Evidence) -> tuple[int, int, int, int]:
    """Rows and columns without openings that the sides cut, such as a neighbour's or those of a ground floor."""
    labels = fill_sky_and_unknown(photo.parsing.labels)
    structure = find_floors_and_bays(labels)
    columns = (0, labels.shape[1]) if structure is None else find_whole_columns(labels, structure)
    return 0, len(labels), *columns


def find_whole_columns(labels: UInt8Array, structure: FloorsAndBays) -> tuple[int, int]:
    """Find the columns between the windows and doors, of any floor, that the sides of a picture cut through.

    Parameters
    ----------
    labels : (h, w) uint8 class ids.
    structure : its floors and bays; at least one bay is kept.

    Returns
    -------
    First column, and the one after the last.
    """
    width = labels.shape[1]
    margin = SIDE_MARGIN_SHARE * width
    opening = np.isin(labels, (FacadeClass.WINDOW, FacadeClass.DOOR))
    boxes = cv2.connectedComponentsWithStats(opening.astype(np.uint8))[2][1:]
    tall = boxes[boxes[:, cv2.CC_STAT_HEIGHT] >= np.median(np.diff(structure.floors)) / 3]
    first, last = tall[:, cv2.CC_STAT_LEFT], tall[:, cv2.CC_STAT_LEFT] + tall[:, cv2.CC_STAT_WIDTH]
    start = max(last[first <= margin], default=0)
    stop = min(first[last >= width - margin], default=width)
    free = spans_above_threshold(1.0 - opening.mean(axis=0), 1.0 - MAX_CUT_SHARE)
    x0 = next(((max(a, start) + b) // 2 for a, b in free if b > start), 0) if start > 0 else 0
    x1 = next(((a + min(b, stop)) // 2 for a, b in free[::-1] if a < stop), width) if stop < width else width
    return (x0, x1) if any(x0 < a and b < x1 for a, b in structure.bays) else (0, width)
