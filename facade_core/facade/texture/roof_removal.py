"""Exemplar without its roof, for walls above which the model has a roof of its own."""

from __future__ import annotations

import cv2
import numpy as np

from facade_core.core.arrays import UInt8Array
from facade_core.core.labels import UNKNOWN, FacadeClass
from facade_core.facade.texture.settings import ROOF_REMOVAL
from facade_core.parsing.floor_structure import find_floors_and_bays

# Classes above the wall: the roof, its windows, and balconies before them.
_CLASSES_ABOVE = (FacadeClass.ROOF, FacadeClass.SKY, FacadeClass.WINDOW, FacadeClass.BALCONY, UNKNOWN)


def cut_off_roof(image: UInt8Array, labels: UInt8Array) -> tuple[UInt8Array, UInt8Array]:
    """Cut an exemplar off above its wall: without the floors in the roof, and without the strip of roof over a floor.

    The cornice or parapet over the highest floor of the wall stays and closes it. A roof or sky that the labels take for
    wall is found by its colour. Without a roof nothing changes.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    labels : (H, W) uint8 class ids.

    Returns
    -------
    Image and labels, both (H - k, W).
    """
    found = find_floors_and_bays(labels)
    if found is None:
        return image, labels
    highest = next(number for number, kind in enumerate(found.kinds) if kind != "roof")
    over, first = labels[: found.floors[highest][0]], 0
    if (over == FacadeClass.ROOF).any():
        above = np.isin(over, _CLASSES_ABOVE).mean(axis=1) > 1 - ROOF_REMOVAL.min_wall_share
        first = int(np.flatnonzero(above)[-1]) + 1 if above.any() else 0
    first += _count_foreign_rows(image[first:], labels[first:])
    if not first:
        return image, labels
    return np.ascontiguousarray(image[first:]), np.ascontiguousarray(labels[first:])


def _count_foreign_rows(image: UInt8Array, labels: UInt8Array) -> int:
    """Count the rows at the top that show a roof, dormers or the sky in place of a wall, by colour, whatever their labels."""
    found = find_floors_and_bays(labels)
    if found is None or len(found.floors) < 2:
        return 0
    top, low = found.floors[0][0], min(found.floors[1][0], found.ground_top)
    first = low if low < found.ground_top else top  # a single upper floor is compared with its own wall
    lab = cv2.cvtColor(image[: found.ground_top].astype(np.float32) / 255, cv2.COLOR_RGB2LAB)
    classes = labels[: found.ground_top]
    below = lab[first:][classes[first:] == FacadeClass.WALL]
    if not len(below):
        return 0
    is_shown = ~np.isin(classes, (FacadeClass.WINDOW, FacadeClass.BALCONY))
    wall = np.median(below, axis=0)
    rows = np.array([np.median(lab[row][is_shown[row]], axis=0) if is_shown[row].any() else wall for row in range(low)])
    is_foreign = np.linalg.norm(rows[:, 1:] - wall[1:], axis=1) > ROOF_REMOVAL.min_chroma_difference
    is_foreign |= rows[:, 0] < wall[0] - ROOF_REMOVAL.min_darkening
    shares = np.cumsum(is_foreign) / np.arange(1, low + 1)
    last = np.flatnonzero(is_foreign & (shares >= ROOF_REMOVAL.min_foreign_share))
    count = int(last[-1]) + 1 if len(last) else 0
    if count < ROOF_REMOVAL.min_foreign_storeys * (low - top):
        return 0
    return min(count, top)  # a floor of another colour stays
