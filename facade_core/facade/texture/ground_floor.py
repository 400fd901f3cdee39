"""A ground floor to live on: of an exemplar with shops, for walls where the map has none."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np

from facade_core.core.labels import FacadeClass
from facade_core.parsing.floor_structure import find_structure

# Wall that stays beside a door, as a share of the ground floor's height.
_JAMB_SHARE = 0.12


def replace_shops(image: np.ndarray, labels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """An exemplar (H, W, 3) uint8 with labels (H, W) of which the ground floor shows windows instead of shops.

    They are those of the lowest storey with the fewest balconies, not the topmost where there is another, brought to its
    height; a bay without a balcony stands in for one with. Doors stay. As it is where it shows no shop, or no storey that
    could stand in.
    """
    found = find_structure(labels)
    middle = [] if found is None else [i for i, kind in enumerate(found.kinds) if kind == "middle"]
    if found is None or not middle or not (labels == FacadeClass.SHOP).any():
        return image, labels
    storeys = [slice(*found.floor_cuts[i : i + 2]) for i in (middle[1:] or middle)[::-1]]
    storey = min(storeys, key=lambda rows: float((labels[rows] == FacadeClass.BALCONY).mean()))
    top, bottom = found.ground_top, found.bottom
    bays = [slice(a, b) for a, b in pairwise((0, *found.bay_cuts[1:-1], labels.shape[1]))]
    plain = [not (labels[storey, bay] == FacadeClass.BALCONY).any() for bay in bays]
    rim = round(_JAMB_SHARE * (bottom - top))
    door = (labels[top:bottom] == FacadeClass.DOOR).any(axis=0).astype(np.uint8)[None]
    free = cv2.dilate(door, np.ones((1, 2 * rim + 1), np.uint8))[0] == 0
    new_image, new_labels = image.copy(), labels.copy()
    for number, bay in enumerate(bays):
        # the nearest of those without, the bay itself first
        shown = min(range(len(bays)), key=lambda other: (any(plain) and not plain[other], abs(other - number)))
        size, kept = (bay.stop - bay.start, bottom - top), free[bay]
        source = storey, bays[shown]
        new_image[top:bottom, bay][:, kept] = cv2.resize(image[source], size, interpolation=cv2.INTER_AREA)[:, kept]
        new_labels[top:bottom, bay][:, kept] = cv2.resize(labels[source], size, interpolation=cv2.INTER_NEAREST)[
            :, kept
        ]
    return new_image, new_labels
