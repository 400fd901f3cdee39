"""Light of a shop at night: ceiling lamps, a back wall that darkens downwards, and shelves or a table."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from facade_core.core.arrays import Float32Array, FloatArray

# Light of the back wall below the lamps.
WALL_LIGHT_TOP = 0.75
# Light of the back wall at the floor.
WALL_LIGHT_FLOOR = 0.28
# Share of the height over which it falls off.
WALL_FALLOFF = 0.4
# Distance between lamps, metres.
LAMP_SPACING_M = 1.3
# Vertical position of lamps, share of the height from the top.
LAMP_TOP = 0.07
# Height of a lamp, share of the height.
LAMP_HEIGHT = 0.035
# Width of a lamp, metres.
LAMP_WIDTH_M = 0.1
# Light that a lamp adds.
LAMP_LIGHT = 0.5
# Light that its cone adds to the wall.
CONE_LIGHT = 0.16
# Share of shops with shelves; the others have a table.
SHELVED_SHARE = 0.6
# Shelf boards, shares of the height from the top.
BOARD_HEIGHTS = (0.34, 0.56, 0.78)
# Thickness of a board, share of the height.
BOARD_THICKNESS = 0.018
# Factor on the light of a board.
BOARD_LIGHT = 0.35
# Width of an article on a shelf, metres.
GOODS_WIDTH_M = 0.22
# Share of places with an article.
GOODS_SHARE = 0.8
# Range of an article's height, shares of the shelf.
GOODS_HEIGHT_RANGE = (0.4, 0.9)
# Range of an article's brightness.
GOODS_LIGHT_RANGE = (0.2, 1.1)
# Linear RGB tints of articles.
GOODS_TINTS = np.array(
    [[1.0, 1.0, 1.0], [1.1, 0.62, 0.45], [0.7, 0.85, 0.6], [0.6, 0.75, 1.05], [1.05, 0.9, 0.6], [0.75, 0.6, 0.55]],
    np.float32,
)
# Top of a table, share of the height from the top; one lamp hangs lower above it.
TABLE_TOP = 0.68
# Factor on the light below the table.
UNDER_TABLE_LIGHT = 0.4
# Start of the floor, share of the height from the top.
FLOOR_TOP = 0.93
# Factor on the light of the floor.
FLOOR_LIGHT = 0.6


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
    light = (WALL_LIGHT_FLOOR + (WALL_LIGHT_TOP - WALL_LIGHT_FLOOR) * np.exp(-np.square(y / WALL_FALLOFF)))[
        :, None
    ] * np.ones((1, wide))
    to_lamp = (x + LAMP_SPACING_M * uniform(41)) % LAMP_SPACING_M - LAMP_SPACING_M / 2
    cone = np.exp(-np.square(to_lamp[None] / (0.15 + 0.9 * y[:, None]))) * np.exp(-2.5 * y)[:, None]
    light = light + CONE_LIGHT * cone
    shown = np.repeat(light[..., None], 3, axis=2).astype(np.float32)
    if kind < SHELVED_SHARE:
        _draw_shelves(shown, x, y, uniform)
    else:
        shown[y > TABLE_TOP] *= UNDER_TABLE_LIGHT
        hangs = (
            np.square((y - LAMP_TOP - 0.2) / (2 * LAMP_HEIGHT))[:, None] + np.square(to_lamp / (2 * LAMP_WIDTH_M))[None]
        )
        shown += LAMP_LIGHT * np.exp(-hangs)[..., None]
    shown[y > FLOOR_TOP] *= FLOOR_LIGHT
    lamps = np.square((y - LAMP_TOP) / LAMP_HEIGHT)[:, None] + np.square(to_lamp / LAMP_WIDTH_M)[None]
    interior_light: Float32Array = (shown + LAMP_LIGHT * np.exp(-lamps)[..., None]).astype(np.float32)
    return interior_light


def _draw_shelves(shown: Float32Array, x: FloatArray, y: FloatArray, uniform: Callable[..., float]) -> None:
    """Draw shelves and goods into the light (h, w, 3); x (w,) in metres, y (h,) as share of the height."""
    goods = np.floor(x / GOODS_WIDTH_M).astype(int)
    step = BOARD_HEIGHTS[1] - BOARD_HEIGHTS[0]
    for row, board in enumerate(BOARD_HEIGHTS):
        for number in range(goods[-1] + 1):
            if uniform(row, number, 43) >= GOODS_SHARE:
                continue
            tall = step * (
                GOODS_HEIGHT_RANGE[0] + (GOODS_HEIGHT_RANGE[1] - GOODS_HEIGHT_RANGE[0]) * uniform(row, number, 44)
            )
            bright = GOODS_LIGHT_RANGE[0] + (GOODS_LIGHT_RANGE[1] - GOODS_LIGHT_RANGE[0]) * uniform(row, number, 45)
            tint = GOODS_TINTS[int(uniform(row, number, 46) * len(GOODS_TINTS))]
            rows, columns = np.flatnonzero((y > board - tall) & (y < board)), np.flatnonzero(goods == number)
            shown[np.ix_(rows, columns)] *= bright * tint
        shown[(y > board) & (y < board + BOARD_THICKNESS)] *= BOARD_LIGHT
