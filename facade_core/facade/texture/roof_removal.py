"""Exemplar without its roof, for walls above which the model has a roof of its own."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import UInt8Array
from facade_core.core.labels import UNKNOWN, FacadeClass
from facade_core.parsing.floor_structure import find_floors_and_bays

# Smallest share of wall in a row of a frieze, parapet or cornice, which closes the wall.
MIN_WALL_SHARE = 0.5
# Classes above the wall: the roof, its windows, and balconies before them.
_CLASSES_ABOVE = (FacadeClass.ROOF, FacadeClass.SKY, FacadeClass.WINDOW, FacadeClass.BALCONY, UNKNOWN)


def cut_off_roof(image: UInt8Array, labels: UInt8Array) -> tuple[UInt8Array, UInt8Array]:
    """Cut an exemplar off above its wall: without the floors in the roof, and without the strip of roof over a floor.

    The cornice or parapet over the highest floor of the wall stays and closes it. Without a roof nothing changes.

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
    over = labels[: found.floors[highest][0]]
    if not (over == FacadeClass.ROOF).any():
        return image, labels
    above = np.isin(over, _CLASSES_ABOVE).mean(axis=1) > 1 - MIN_WALL_SHARE
    first = int(np.flatnonzero(above)[-1]) + 1 if above.any() else 0
    return np.ascontiguousarray(image[first:]), np.ascontiguousarray(labels[first:])
