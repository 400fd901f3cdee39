"""A painted facade as a city model with openings would show it: grey, windows and doors set back, balconies before them."""

from __future__ import annotations

import numpy as np

from facade_core.core.labels import FacadeClass

# Grey of each class under soft light: what lies back is darker.
_GREY = {
    FacadeClass.WALL: 212,
    FacadeClass.WINDOW: 158,
    FacadeClass.BALCONY: 196,
    FacadeClass.DOOR: 148,
    FacadeClass.ROOF: 184,
    FacadeClass.SHOP: 166,
}
_SHADOW, _LIT_SILL = 92, 236


def relief_image(labels: np.ndarray, metres_per_pixel: float) -> np.ndarray:
    """Grey (h, w) uint8 of a facade's labels (h, w): openings have a shadow below their head and a lit sill."""
    grey = np.full(labels.shape, _GREY[FacadeClass.WALL], np.uint8)
    for name, value in _GREY.items():
        grey[labels == name] = value
    depth = max(1, round(0.12 / metres_per_pixel))
    opening = np.isin(labels, (FacadeClass.WINDOW, FacadeClass.DOOR, FacadeClass.SHOP))
    above = np.zeros_like(opening)
    above[depth:] = opening[:-depth]
    grey[opening & ~above] = _SHADOW
    grey[~opening & above & (labels == FacadeClass.WALL)] = _LIT_SILL
    return grey
