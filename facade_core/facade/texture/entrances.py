"""Places of doors: at mapped entrances, and on backs."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from facade_core.core.arrays import Float64Array, Int32Array
from facade_core.core.labels import FacadeClass
from facade_core.facade.texture.retargeting import ExemplarAnalysis
from facade_core.facade.texture.settings import ENTRANCES


def place_doors(style: ExemplarAnalysis, entrances: Sequence[float], source: Int32Array, across: Float64Array) -> None:
    """Replace bays by a bay with a door at mapped entrances, unless a neighbouring bay shows a door or a shop.

    A bay whose replacement cuts an element stays.

    Parameters
    ----------
    style : analysed exemplar.
    entrances : mapped doors, metres from the left.
    source : (2, m, 3 n) rows and columns of the exemplar's lattice of the ground floor; changed in place.
    across : (3 n + 1,) borders of columns, metres.
    """
    doors = np.flatnonzero(style.doors)
    if not len(doors):
        return
    cuts, band = style.structure.bay_cuts, slice(style.structure.ground_top, style.structure.bottom)
    shop = [(style.labels[band, a:b] == FacadeClass.SHOP).any() for a, b in pairwise(cuts)]
    has_entrance = np.array([*(style.doors | np.array(shop)), False])  # the last entry is bare wall
    for place in entrances:
        own = int(np.clip(np.searchsorted(across[3::3], place), 0, source.shape[2] // 3 - 1))
        bay_shown = np.minimum(source[1, -1, ::3] // 3, len(has_entrance) - 1)
        walled = bay_shown[own] == len(has_entrance) - 1
        if not walled and not has_entrance[bay_shown[max(0, own - 1) : own + 2]].any():
            others = source[1, -1, ::3] // 3
            others[own] = doors[own % len(doors)]
            if max(others) >= len(style.doors) or not style.bay_price["ground"].cuts_elements(others):
                source[1, :, 3 * own : 3 * own + 3] = 3 * others[own] + np.arange(3)


def choose_door_position(
    free: BaseGeometry,
    size: tuple[float, float],
    across: Float64Array,
    seams: Sequence[float],
    entrances: Sequence[float],
    rng: np.random.Generator,
) -> float | None:
    """Choose the centre of a back's door, metres from the left.

    It is in the bay nearest to a mapped entrance, else in a random one, if possible not in the outer fifths of the
    wall.

    Parameters
    ----------
    free : free part of the wall.
    size : (width, height) of the wall, metres.
    across : borders of bays and windows as in `compose_wall`, metres.
    seams : positions of bends, metres.
    entrances : mapped entrances, metres.
    rng : draws the bay.

    Returns
    -------
    None without room for a door.
    """
    width, height = size
    middles = (across[1:-1:3] + across[2::3]) / 2 if len(across) > 2 else np.array([width / 2])
    reach = ENTRANCES.door_size_m[0] / 2 + ENTRANCES.door_margin_m
    open_ = free.buffer(0.02)
    fits = [
        middle
        for middle in middles.tolist()
        if reach <= middle <= width - reach
        and all(abs(seam - middle) > reach for seam in seams)
        and open_.covers(shapely.box(middle - reach, height - ENTRANCES.door_size_m[1], middle + reach, height - 0.05))
    ]
    if entrances and fits:
        nearest: float = min(fits, key=lambda middle: abs(middle - entrances[0]))
        return nearest
    inner = [middle for middle in fits if 0.2 * width < middle < 0.8 * width] or fits
    return inner[int(rng.integers(len(inner)))] if inner else None
