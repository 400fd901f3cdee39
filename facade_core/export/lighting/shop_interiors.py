"""Light of a shop at night: ceiling lamps, a back wall that darkens downwards, and shelves or a table."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from facade_core.core.arrays import Float32Array, FloatArray
from facade_core.export.lighting.settings import SHOP_INTERIORS, ShopInteriorSettings

# Linear RGB tints of articles.
GOODS_TINTS = np.array(
    [[1.0, 1.0, 1.0], [1.1, 0.62, 0.45], [0.7, 0.85, 0.6], [0.6, 0.75, 1.05], [1.05, 0.9, 0.6], [0.75, 0.6, 0.55]],
    np.float32,
)


def shop_interior_light(
    shape: tuple[int, int],
    density: float,
    kind: float,
    uniform: Callable[..., float],
    settings: ShopInteriorSettings = SHOP_INTERIORS,
) -> Float32Array:
    """Compute the light of a shop pane relative to its lamps.

    The result is the same at any density, except for details below one texel.

    Parameters
    ----------
    shape : (h, w) texels of the pane.
    density : texels per metre.
    kind : 0 to 1, selects shelves or a table.
    uniform : returns a number 0 to 1 for integer keys, seeded by the pane.
    settings : numbers of the interior.

    Returns
    -------
    (h, w, 3) float32 linear.
    """
    high, wide = shape
    x, y = (np.arange(wide, dtype=np.float32) + 0.5) / density, (np.arange(high, dtype=np.float32) + 0.5) / high
    light = (
        settings.wall_light_floor
        + (settings.wall_light_top - settings.wall_light_floor) * np.exp(-np.square(y / settings.wall_falloff))
    )[:, None] * np.ones((1, wide))
    to_lamp = (x + settings.lamp_spacing_m * uniform(41)) % settings.lamp_spacing_m - settings.lamp_spacing_m / 2
    cone = np.exp(-np.square(to_lamp[None] / (0.15 + 0.9 * y[:, None]))) * np.exp(-2.5 * y)[:, None]
    light = light + settings.cone_light * cone
    shown = np.repeat(light[..., None], 3, axis=2).astype(np.float32)
    if kind < settings.shelved_share:
        _draw_shelves(shown, x, y, uniform, settings)
    else:
        shown[y > settings.table_top] *= settings.under_table_light
        hangs = (
            np.square((y - settings.lamp_top - 0.2) / (2 * settings.lamp_height))[:, None]
            + np.square(to_lamp / (2 * settings.lamp_width_m))[None]
        )
        shown += settings.lamp_light * np.exp(-hangs)[..., None]
    shown[y > settings.floor_top] *= settings.floor_light
    lamps = (
        np.square((y - settings.lamp_top) / settings.lamp_height)[:, None]
        + np.square(to_lamp / settings.lamp_width_m)[None]
    )
    interior_light: Float32Array = (shown + settings.lamp_light * np.exp(-lamps)[..., None]).astype(np.float32)
    return interior_light


def _draw_shelves(
    shown: Float32Array, x: FloatArray, y: FloatArray, uniform: Callable[..., float], settings: ShopInteriorSettings
) -> None:
    """Draw shelves and goods into the light (h, w, 3); x (w,) in metres, y (h,) as share of the height."""
    goods = np.floor(x / settings.goods_width_m).astype(int)
    step = settings.board_heights[1] - settings.board_heights[0]
    for row, board in enumerate(settings.board_heights):
        for number in range(goods[-1] + 1):
            if uniform(row, number, 43) >= settings.goods_share:
                continue
            tall = step * (
                settings.goods_height_range[0]
                + (settings.goods_height_range[1] - settings.goods_height_range[0]) * uniform(row, number, 44)
            )
            bright = settings.goods_light_range[0] + (
                settings.goods_light_range[1] - settings.goods_light_range[0]
            ) * uniform(row, number, 45)
            tint = GOODS_TINTS[int(uniform(row, number, 46) * len(GOODS_TINTS))]
            rows, columns = np.flatnonzero((y > board - tall) & (y < board)), np.flatnonzero(goods == number)
            shown[np.ix_(rows, columns)] *= bright * tint
        shown[(y > board) & (y < board + settings.board_thickness)] *= settings.board_light
