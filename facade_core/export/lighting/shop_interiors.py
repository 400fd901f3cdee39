"""Light of a shop at night: ceiling lamps, a back wall that darkens downwards, and shelves or a table."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from facade_core.core.arrays import Float32Array, FloatArray
from facade_core.export.lighting.settings import SHOP_INTERIORS

# Linear RGB tints of articles.
GOODS_TINTS = np.array(
    [[1.0, 1.0, 1.0], [1.1, 0.62, 0.45], [0.7, 0.85, 0.6], [0.6, 0.75, 1.05], [1.05, 0.9, 0.6], [0.75, 0.6, 0.55]],
    np.float32,
)


def shop_interior_light(
    shape: tuple[int, int], density: float, kind: float, uniform: Callable[..., float]
) -> Float32Array:
    """Compute the light of a shop pane relative to its lamps.

    The result is the same at any density, except for details below one texel.

    Parameters
    ----------
    shape : (h, w) texels of the pane.
    density : texels per metre.
    kind : 0 to 1, selects shelves or a table.
    uniform : returns a number 0 to 1 for integer keys, seeded by the pane.

    Returns
    -------
    (h, w, 3) float32 linear.
    """
    high, wide = shape
    x, y = (np.arange(wide, dtype=np.float32) + 0.5) / density, (np.arange(high, dtype=np.float32) + 0.5) / high
    light = (
        SHOP_INTERIORS.wall_light_floor
        + (SHOP_INTERIORS.wall_light_top - SHOP_INTERIORS.wall_light_floor)
        * np.exp(-np.square(y / SHOP_INTERIORS.wall_falloff))
    )[:, None] * np.ones((1, wide))
    to_lamp = (
        x + SHOP_INTERIORS.lamp_spacing_m * uniform(41)
    ) % SHOP_INTERIORS.lamp_spacing_m - SHOP_INTERIORS.lamp_spacing_m / 2
    cone = np.exp(-np.square(to_lamp[None] / (0.15 + 0.9 * y[:, None]))) * np.exp(-2.5 * y)[:, None]
    light = light + SHOP_INTERIORS.cone_light * cone
    shown = np.repeat(light[..., None], 3, axis=2).astype(np.float32)
    if kind < SHOP_INTERIORS.shelved_share:
        _draw_shelves(shown, x, y, uniform)
    else:
        shown[y > SHOP_INTERIORS.table_top] *= SHOP_INTERIORS.under_table_light
        hangs = (
            np.square((y - SHOP_INTERIORS.lamp_top - 0.2) / (2 * SHOP_INTERIORS.lamp_height))[:, None]
            + np.square(to_lamp / (2 * SHOP_INTERIORS.lamp_width_m))[None]
        )
        shown += SHOP_INTERIORS.lamp_light * np.exp(-hangs)[..., None]
    shown[y > SHOP_INTERIORS.floor_top] *= SHOP_INTERIORS.floor_light
    lamps = (
        np.square((y - SHOP_INTERIORS.lamp_top) / SHOP_INTERIORS.lamp_height)[:, None]
        + np.square(to_lamp / SHOP_INTERIORS.lamp_width_m)[None]
    )
    interior_light: Float32Array = (shown + SHOP_INTERIORS.lamp_light * np.exp(-lamps)[..., None]).astype(np.float32)
    return interior_light


def _draw_shelves(shown: Float32Array, x: FloatArray, y: FloatArray, uniform: Callable[..., float]) -> None:
    """Draw shelves and goods into the light (h, w, 3); x (w,) in metres, y (h,) as share of the height."""
    goods = np.floor(x / SHOP_INTERIORS.goods_width_m).astype(int)
    step = SHOP_INTERIORS.board_heights[1] - SHOP_INTERIORS.board_heights[0]
    for row, board in enumerate(SHOP_INTERIORS.board_heights):
        for number in range(goods[-1] + 1):
            if uniform(row, number, 43) >= SHOP_INTERIORS.goods_share:
                continue
            tall = step * (
                SHOP_INTERIORS.goods_height_range[0]
                + (SHOP_INTERIORS.goods_height_range[1] - SHOP_INTERIORS.goods_height_range[0])
                * uniform(row, number, 44)
            )
            bright = SHOP_INTERIORS.goods_light_range[0] + (
                SHOP_INTERIORS.goods_light_range[1] - SHOP_INTERIORS.goods_light_range[0]
            ) * uniform(row, number, 45)
            tint = GOODS_TINTS[int(uniform(row, number, 46) * len(GOODS_TINTS))]
            rows, columns = np.flatnonzero((y > board - tall) & (y < board)), np.flatnonzero(goods == number)
            shown[np.ix_(rows, columns)] *= bright * tint
        shown[(y > board) & (y < board + SHOP_INTERIORS.board_thickness)] *= SHOP_INTERIORS.board_light
