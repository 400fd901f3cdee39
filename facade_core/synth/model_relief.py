"""A painted facade as a city model with openings would show it: grey, windows and doors set back, balconies before them."""

from __future__ import annotations

import numpy as np

from facade_core.core.labels import BALCONY, DOOR, ROOF, SHOP, WALL, WINDOW

# Grey of each class under soft light: what lies back is darker.
_GREY = {WALL: 212, WINDOW: 158, BALCONY: 196, DOOR: 148, ROOF: 184, SHOP: 166}
_SHADOW, _LIT = 92, 236


def relief(labels: np.ndarray, metres_per_pixel: float) -> np.ndarray:
    """Grey (h, w) uint8 of a facade's labels (h, w): openings have a shadow below their head and a lit sill."""
    grey = np.full(labels.shape, _GREY[WALL], np.uint8)
    for name, value in _GREY.items():
        grey[labels == name] = value
    depth = max(1, round(0.12 / metres_per_pixel))
    opening = np.isin(labels, (WINDOW, DOOR, SHOP))
    above = np.zeros_like(opening)
    above[depth:] = opening[:-depth]
    grey[opening & ~above] = _SHADOW
    grey[~opening & above & (labels == WALL)] = _LIT
    return grey
