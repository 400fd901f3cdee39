"""Rendering of a painted facade as an untextured city model with recessed openings and balconies."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import UInt8Array
from facade_core.core.labels import FacadeClass

# Grey of each class under soft light; recessed classes are darker.
_GREY = {
    FacadeClass.WALL: 212,
    FacadeClass.WINDOW: 158,
    FacadeClass.BALCONY: 196,
    FacadeClass.DOOR: 148,
    FacadeClass.ROOF: 184,
    FacadeClass.SHOP: 166,
}
_SHADOW = 92
_LIT_SILL = 236


def render_facade_relief(labels: UInt8Array, metres_per_pixel: float) -> UInt8Array:
    """Render a label map as grey, untextured relief: openings are recessed and shadowed.

    Parameters
    ----------
    labels : (h, w) uint8 class ids.
    metres_per_pixel : resolution.

    Returns
    -------
    grey : (h, w) uint8.
    """
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
