"""What a lit shop shows at night: lamps under its ceiling, a wall behind that darkens towards the floor, goods on shelves or a
table before it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

# The wall behind: light below the lamps and at the floor, and over which share of the height it falls off.
WALL_LIGHT_TOP, WALL_LIGHT_FLOOR, WALL_FALLOFF = 0.75, 0.28, 0.4
# Lamps: metres from one to the next, where they hang and how large they are, shares of the height, metres wide; what each
# adds, and what its cone adds to the wall.
LAMP_SPACING_M, LAMP_TOP, LAMP_HEIGHT, LAMP_WIDTH_M, LAMP_LIGHT, CONE_LIGHT = 1.3, 0.07, 0.035, 0.1, 0.5, 0.16
# Shelves: the share of shops with some; their boards, shares of the height, and how thick and how bright these are.
SHELVED_SHARE, BOARD_HEIGHTS, BOARD_THICKNESS, BOARD_LIGHT = 0.6, (0.34, 0.56, 0.78), 0.018, 0.35
# Goods: metres that one takes, shares of them that are there, their height in their shelf, brightness, and tints, linear.
GOODS_WIDTH_M, GOODS_SHARE, GOODS_HEIGHT_RANGE, GOODS_LIGHT_RANGE = 0.22, 0.8, (0.4, 0.9), (0.2, 1.1)
GOODS_TINTS = np.array(
    [[1.0, 1.0, 1.0], [1.1, 0.62, 0.45], [0.7, 0.85, 0.6], [0.6, 0.75, 1.05], [1.05, 0.9, 0.6], [0.75, 0.6, 0.55]],
    np.float32,
)
# Else a table: where its top is, how bright what is below it; one lamp hangs lower above it.
TABLE_TOP, UNDER_TABLE_LIGHT = 0.68, 0.4
# From here down is the floor, so bright.
FLOOR_TOP, FLOOR_LIGHT = 0.93, 0.6


def shop_interior_light(
    shape: tuple[int, int], density: float, kind: float, uniform: Callable[..., float]
) -> np.ndarray:
    """Light (h, w, 3) float32 of a shop's pane of so many texels (h, w), shares of its lamps' light. kind: 0..1, what the shop
    is; uniform: a number 0..1 for whole numbers, the pane's own. The same at any density, but for what is smaller than a
    texel."""
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
    return (shown + LAMP_LIGHT * np.exp(-lamps)[..., None]).astype(np.float32)


def _draw_shelves(shown: np.ndarray, x: np.ndarray, y: np.ndarray, uniform: Callable[..., float]) -> None:
    """Draw shelves and what stands on them into the light (h, w, 3) of places x (w,) metres and y (h,) of the height."""
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
