"""Varied sets of painted facades, for walls without imagery and as training input."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.painter.facade import PaintedFacade, paint_facade
from benchmarks.painter.styles import STYLE_BY_NAME, STYLES
from facade_core.core.errors import LayoutError

UPPER_FLOOR_HEIGHT_M = 3.2  # mean height of floors above the ground floor


def paint_exemplar_set(
    n: int, *, seed: int, metres_per_pixel: float = 0.05, occluded_share: float = 0.0
) -> list[PaintedFacade]:
    """Paint n facades with `paint_exemplar`.

    Parameters
    ----------
    n : number of facades.
    seed : seed of the set.
    metres_per_pixel : resolution.
    occluded_share : share of facades with one to three occluders, rounded to whole facades and spread over the list.

    Raises
    ------
    LayoutError
        `n` or `seed` is negative, or the share is outside 0..1.
    """
    if not isinstance(n, int | np.integer) or n < 0:
        raise LayoutError(f"exemplars n is {n!r}; use a whole number of at least 0")
    if not 0 <= occluded_share <= 1:
        raise LayoutError(f"exemplars occluded_share is {occluded_share!r}; use a value from 0 to 1")
    if not isinstance(seed, int | np.integer) or seed < 0:
        raise LayoutError(f"exemplars seed is {seed!r}; use a whole number of at least 0")
    # Bresenham's rule: occluded facades are evenly spread, and there are round(n * share) of them.
    busy = [round((i + 1) * occluded_share) > round(i * occluded_share) for i in range(n)]
    return [paint_exemplar(i, seed=seed, metres_per_pixel=metres_per_pixel, occluded=busy[i]) for i in range(n)]


def paint_exemplar(
    index: int,
    *,
    seed: int,
    metres_per_pixel: float = 0.05,
    occluded: bool = False,
    styles: Sequence[str] = STYLES,
) -> PaintedFacade:
    """Paint the facade of an index: 3-7 floors of about 3.2 m, 3-8 columns, 10-26 m wide.

    Parameters
    ----------
    index : number in the set; selects the style in turn.
    seed : seed of the set.
    metres_per_pixel : resolution.
    occluded : add one to three occluders.
    styles : names of the styles to use.
    """
    rng = np.random.default_rng([seed, index])
    style = STYLE_BY_NAME[styles[index % len(styles)]]
    floors, columns = int(rng.integers(3, 8)), int(rng.integers(3, 9))
    width = float(np.clip(columns * rng.uniform(2.5, 3.4), 10, 26))
    height = (
        UPPER_FLOOR_HEIGHT_M * rng.uniform(0.96, 1.05) * (floors - 1 + style.ground_share)
        + style.crown
        + style.roof_height
    )
    return paint_facade(
        (float(height), width),
        floors=floors,
        columns=columns,
        style=style.name,
        metres_per_pixel=metres_per_pixel,
        seed=int(rng.integers(2**31)),
        occluders=int(rng.integers(1, 4)) if occluded else 0,
    )
