"""Residential ground floor of an exemplar with shops, for walls without mapped shops."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np

from facade_core.core.arrays import UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.facade.texture.settings import GROUND_FLOOR
from facade_core.parsing.floor_structure import find_floors_and_bays, spans_above_threshold


def replace_shops_by_windows(image: UInt8Array, labels: UInt8Array) -> tuple[UInt8Array, UInt8Array]:
    """Replace the shops of an exemplar's ground floor by windows of an upper floor.

    The source is the lowest floor with the fewest balconies, if possible not the topmost, scaled to the height of the
    ground floor. A bay without balconies replaces one with balconies. Doors that reach the ground stay. Without shops or a
    source floor nothing changes.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    labels : (H, W) uint8 class ids.

    Returns
    -------
    Image and labels.
    """
    found = find_floors_and_bays(labels)
    middle = [] if found is None else [i for i, kind in enumerate(found.kinds) if kind == "middle"]
    if found is None or not middle or not (labels == FacadeClass.SHOP).any():
        return image, labels
    floors = [slice(*found.floor_cuts[i : i + 2]) for i in (middle[1:] or middle)[::-1]]
    source_rows = min(floors, key=lambda rows: float((labels[rows] == FacadeClass.BALCONY).mean()))
    top, bottom = found.ground_top, found.bottom
    bays = [slice(a, b) for a, b in pairwise((0, *found.bay_cuts[1:-1], labels.shape[1]))]
    plain = [not (labels[source_rows, bay] == FacadeClass.BALCONY).any() for bay in bays]
    rim = round(GROUND_FLOOR.jamb_share * (bottom - top))
    is_door = labels[top:bottom] == FacadeClass.DOOR
    foot = is_door[round((1 - GROUND_FLOOR.door_foot_share) * (bottom - top)) :].any(axis=0)
    door = np.zeros((1, labels.shape[1]), np.uint8)
    for left, right in spans_above_threshold(is_door.any(axis=0).astype(np.float64), 0.5):
        door[0, left:right] = foot[left:right].any()
    free = cv2.dilate(door, np.ones((1, 2 * rim + 1), np.uint8))[0] == 0
    new_image, new_labels = image.copy(), labels.copy()
    for number, bay in enumerate(bays):
        # The nearest bay without balconies, the bay itself first.
        nearest = min(range(len(bays)), key=lambda other: (any(plain) and not plain[other], abs(other - number)))
        size, kept = (bay.stop - bay.start, bottom - top), free[bay]
        source = source_rows, bays[nearest]
        new_image[top:bottom, bay][:, kept] = cv2.resize(image[source], size, interpolation=cv2.INTER_AREA)[:, kept]
        new_labels[top:bottom, bay][:, kept] = cv2.resize(labels[source], size, interpolation=cv2.INTER_NEAREST)[
            :, kept
        ]
    return new_image, new_labels
