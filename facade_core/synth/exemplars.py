"""A varied library of painted facades, for walls without imagery and as training input."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.core.errors import LayoutError
from facade_core.synth.facade import PaintedFacade, paint_facade
from facade_core.synth.facade_plan import GROUND_SHARE
from facade_core.synth.styles import STYLE_BY_NAME, STYLES

UPPER_FLOOR_HEIGHT_M = 3.2  # metres, upper storeys


def paint_exemplar_set(n: int, *, seed: int, metres_per_pixel: float = 0.05, occluded_share: float = 0.0) -> list[PaintedFacade]:
    """Paint n facades as `exemplar` does. occluded_share of them (rounded to whole facades, spread over the list) have one to
    three things in front. Raises LayoutError for a negative n or a share outside 0..1."""
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
    """Paint the facade of an index in a library: styles in turn, 3-7 floors, 3-8 columns, 10-26 m wide, storeys of about 3.2 m;
    with one to three things in front where it is occluded."""
    rng = np.random.default_rng([seed, index])
    style = STYLE_BY_NAME[styles[index % len(styles)]]
    floors, columns = int(rng.integers(3, 8)), int(rng.integers(3, 9))
    width = float(np.clip(columns * rng.uniform(2.5, 3.4), 10, 26))
    height = UPPER_FLOOR_HEIGHT_M * rng.uniform(0.96, 1.05) * (floors - 1 + GROUND_SHARE) + style.crown + style.roof_height
    return paint_facade(
        (float(height), width),
        floors=floors,
        columns=columns,
        style=style.name,
        metres_per_pixel=metres_per_pixel,
        seed=int(rng.integers(2**31)),
        occluders=int(rng.integers(1, 4)) if occluded else 0,
    )
