"""Statistics of one facade that describe the style of a city: wall, windows, shops, balconies and ground storey."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.facade.wall_material import MIN_TEXELS_PER_METRE, measure_wall_material
from facade_core.parsing.floor_structure import find_floors_and_bays


class FacadeStatistics(NamedTuple):
    """Statistics of a facade.

    Attributes
    ----------
    material : "brick", "plaster", or "unknown" where the picture is too coarse for courses or shows too little wall.
    wall_colour : RGB of the lit wall, 0 to 255; None where too little wall is seen.
    window_share, balcony_share : shares of the facade without its roof.
    shop_share : share of the width with shops.
    ground_storey_ratio : height of the ground storey over that of a typical other one; None without two others.
    """

    material: str
    wall_colour: tuple[int, int, int] | None
    window_share: float
    balcony_share: float
    shop_share: float
    ground_storey_ratio: float | None


def measure_facade_statistics(image: UInt8Array, labels: UInt8Array, metres_per_pixel: float) -> FacadeStatistics:
    """Measure the statistics of a rectified facade.

    Parameters
    ----------
    image : (h, w, 3) uint8.
    labels : (h, w) uint8 class ids.
    metres_per_pixel : scale.
    """
    wall = measure_wall_material(image, labels, 1 / metres_per_pixel)
    material, colour = "unknown", None
    if wall is not None:
        red, green, blue = (round(value) for value in wall.colour.tolist())
        colour = (red, green, blue)
        if 1 / metres_per_pixel >= MIN_TEXELS_PER_METRE:
            material = "brick" if wall.brick else "plaster"
    area = max(1, int((labels != FacadeClass.ROOF).sum()))
    windows, balconies = (
        round(float((labels == each).sum() / area), 4) for each in (FacadeClass.WINDOW, FacadeClass.BALCONY)
    )
    shops = round(float((labels == FacadeClass.SHOP).any(axis=0).mean()), 4)
    return FacadeStatistics(material, colour, windows, balconies, shops, _measure_ground_storey(labels))


def _measure_ground_storey(labels: UInt8Array) -> float | None:
    found = find_floors_and_bays(labels)
    if found is None:
        return None
    middles = [
        (top + below) / 2 for (top, below), kind in zip(found.floors, found.kinds, strict=True) if kind == "middle"
    ]
    if len(middles) < 2 or found.ground_top >= found.bottom:
        return None
    return round(float((found.bottom - found.ground_top) / np.median(np.diff(middles))), 3)
