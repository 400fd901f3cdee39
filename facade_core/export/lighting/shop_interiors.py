"""What a lit shop shows at night: lamps under its ceiling, a wall behind that darkens towards the floor, goods on shelves or a
table before it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

# The wall behind: light below the lamps and at the floor, and over which share of the height it falls off.
UNDER_LAMPS, AT_FLOOR, FALLS = 0.75, 0.28, 0.4
# Lamps: metres from one to the next, where they hang and how large they are, shares of the height, metres wide; what each
# adds, and what its cone adds to the wall.
LAMPS_M, HANGS, HIGH, WIDE_M, LAMP, CONE = 1.3, 0.07, 0.035, 0.1, 0.5, 0.16
# Shelves: the share of shops with some; their boards, shares of the height, and how thick and how bright these are.
SHELVED, BOARDS, THICK, BOARD = 0.6, (0.34, 0.56, 0.78), 0.018, 0.35
# Goods: metres that one takes, shares of them that are there, their height in their shelf, brightness, and tints, linear.
GOODS_M, THERE, TALL, BRIGHT = 0.22, 0.8, (0.4, 0.9), (0.2, 1.1)
TINTS = np.array(
    [[1.0, 1.0, 1.0], [1.1, 0.62, 0.45], [0.7, 0.85, 0.6], [0.6, 0.75, 1.05], [1.05, 0.9, 0.6], [0.75, 0.6, 0.55]],
    np.float32,
)
# Else a table: where its top is, how bright what is below it; one lamp hangs lower above it.
TABLE, UNDER_TABLE = 0.68, 0.4
# From here down is the floor, so bright.
FLOOR, ON_FLOOR = 0.93, 0.6


def interior(shape: tuple[int, int], density: float, kind: float, chance: Callable[..., float]) -> np.ndarray:
    """Light (h, w, 3) float32 of a shop's pane of so many texels (h, w), shares of its lamps' light. kind: 0..1, what the shop
    is; chance: a number 0..1 for whole numbers, the pane's own. The same at any density, but for what is smaller than a
    texel."""
    high, wide = shape
    x, y = (np.arange(wide, dtype=np.float32) + 0.5) / density, (np.arange(high, dtype=np.float32) + 0.5) / high
    light = (AT_FLOOR + (UNDER_LAMPS - AT_FLOOR) * np.exp(-np.square(y / FALLS)))[:, None] * np.ones((1, wide))
    to_lamp = (x + LAMPS_M * chance(41)) % LAMPS_M - LAMPS_M / 2
    cone = np.exp(-np.square(to_lamp[None] / (0.15 + 0.9 * y[:, None]))) * np.exp(-2.5 * y)[:, None]
    light = light + CONE * cone
    shown = np.repeat(light[..., None], 3, axis=2).astype(np.float32)
    if kind < SHELVED:
        _shelve(shown, x, y, chance)
    else:
        shown[y > TABLE] *= UNDER_TABLE
        hangs = np.square((y - HANGS - 0.2) / (2 * HIGH))[:, None] + np.square(to_lamp / (2 * WIDE_M))[None]
        shown += LAMP * np.exp(-hangs)[..., None]
    shown[y > FLOOR] *= ON_FLOOR
    lamps = np.square((y - HANGS) / HIGH)[:, None] + np.square(to_lamp / WIDE_M)[None]
    return (shown + LAMP * np.exp(-lamps)[..., None]).astype(np.float32)


def _shelve(shown: np.ndarray, x: np.ndarray, y: np.ndarray, chance: Callable[..., float]) -> None:
    """Draw shelves and what stands on them into the light (h, w, 3) of places x (w,) metres and y (h,) of the height."""
    goods = np.floor(x / GOODS_M).astype(int)
    step = BOARDS[1] - BOARDS[0]
    for row, board in enumerate(BOARDS):
        for number in range(goods[-1] + 1):
            if chance(row, number, 43) >= THERE:
                continue
            tall = step * (TALL[0] + (TALL[1] - TALL[0]) * chance(row, number, 44))
            bright = BRIGHT[0] + (BRIGHT[1] - BRIGHT[0]) * chance(row, number, 45)
            tint = TINTS[int(chance(row, number, 46) * len(TINTS))]
            rows, columns = np.flatnonzero((y > board - tall) & (y < board)), np.flatnonzero(goods == number)
            shown[np.ix_(rows, columns)] *= bright * tint
        shown[(y > board) & (y < board + THICK)] *= BOARD
