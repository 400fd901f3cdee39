"""The ground floor's doors and shop fronts as tiles."""

from __future__ import annotations

import cv2
import numpy as np

from facade_core.synth.canvas import Canvas, Plate, linear, noise
from facade_core.synth.windows import BAR, FRAME, GLASS, mirrored

SIGNS = (
    "KAHVILA",
    "BAGERI",
    "KIRJAT",
    "VIINI",
    "KUKKA",
    "LEIPOMO",
    "OPTIKKO",
    "CAFE",
    "RADIO",
    "HATUT",
    "PAPERI",
    "APTEEKKI",
)
SIGN_COLOURS = (
    ("#27443b", "#e8d9a8"),
    ("#2c3550", "#ece6d6"),
    ("#6d2a24", "#f0dfb4"),
    ("#22262a", "#e6c56c"),
    ("#e7dcc2", "#5a2a22"),
    ("#3d5a66", "#f2eee2"),
)
AWNINGS = (("#a8382f", "#f0e8d8"), ("#2f5a4a", "#efe8d6"), ("#31507c", "#f0ece0"), ("#c08a2e", "#f3ead2"))
# Of each of SIGN_COLOURS the one of AWNINGS that goes with it.
_AWNING_OF = (1, 2, 0, 3, 0, 2)


def door_tile(
    shape: tuple[int, int], scale: float, colour: np.ndarray, *, modern: bool, rng: np.random.Generator
) -> Canvas:
    """A two-leaved door under a fanlight; modern ones are glazed from the knee up."""
    tile = Canvas.blank(*shape, scale)
    w, h = tile.width_m, tile.height_m
    grain = 1 + 0.06 * noise(shape, (0.9 * scale, 0.02 * scale), rng)
    tile.albedo[:] = colour * grain[..., None]
    tile.relief[:] = -0.24
    light, step = 0.24 * h, min(0.16, 0.06 * h)
    glass = 0.55 * linear("#2a2c30") + 0.42 * mirrored(shape, rng)

    def pane(x0: float, y0: float, x1: float, y1: float) -> None:
        at = tile.region(x0, y0, x1, y1)
        tile.albedo[at], tile.relief[at], tile.gloss[at] = glass[at], -0.28, 1.0

    pane(0.07, 0.07, w - 0.07, light - 0.05)
    for x in np.linspace(0, w, 5)[1:-1]:
        tile.box(x - 0.02, 0.0, x + 0.02, light, colour * 1.15, -0.25)
    tile.box(0, light - 0.06, w, light + 0.06, colour * 1.2, -0.18)
    for side in (0.0, w / 2):
        x0, x1 = side + 0.13, side + w / 2 - 0.13
        tall = h - light - step
        cuts = ((0.10, 0.80),) if modern else ((0.08, 0.50), (0.57, 0.72), (0.78, 0.95))
        for number, (a, b) in enumerate(cuts):
            y0, y1 = light + a * tall, light + b * tall
            if modern or number == 0:
                pane(x0, y0, x1, y1)
                if not modern:
                    tile.box((x0 + x1) / 2 - 0.02, y0, (x0 + x1) / 2 + 0.02, y1, colour * 1.1, -0.25)
            else:
                tile.box(x0, y0, x1, y1, colour * 0.72, -0.28)
                tile.box(x0 + 0.06, y0 + 0.06, x1 - 0.06, y1 - 0.06, colour * 1.12, -0.23)
    tile.box(w / 2 - 0.02, light, w / 2 + 0.02, h, colour * 0.45, -0.27)
    tile.box(
        w / 2 + 0.06, light + 0.50 * (h - light), w / 2 + 0.11, light + 0.62 * (h - light), linear("#d9b75e"), -0.18
    )
    tile.box(0, 0, 0.06, h, colour * 1.15, -0.18)
    tile.box(w - 0.06, 0, w, h, colour * 1.15, -0.18)
    tile.moulding(0, h - step, w, h, linear("#9a958d"), (0.02, 0.02, 0.0))
    return tile


def shop_tile(
    shape: tuple[int, int], scale: float, state: str, word: str, scheme: int, rng: np.random.Generator
) -> tuple[Canvas, Plate | None]:
    """A shop front in the colours of a scheme, a number, with its sign; the awning, if it is out, comes as a plate placed
    relative to the tile."""
    tile = Canvas.blank(*shape, scale)
    w, h = tile.width_m, tile.height_m
    ground, ink = (linear(c) for c in SIGN_COLOURS[scheme % len(SIGN_COLOURS)])
    sign, riser = min(0.62, 0.19 * h), min(0.5, 0.15 * h)
    wood = ground if float(ground.max()) < 0.4 else linear("#4a3428")
    tile.albedo[:] = wood
    tile.relief[:] = -0.06
    glass_top, glass_end = sign + 0.12, h - riser
    _display(tile, 0.10, glass_top, w - 0.10, glass_end, rng)
    door_w = min(0.95, 0.34 * w)
    left = bool(rng.random() < 0.5)
    dx = 0.16 if left else w - 0.16 - door_w
    at = tile.region(dx, glass_end - 0.02, dx + door_w, h - 0.30)
    tile.albedo[at], tile.gloss[at], tile.relief[at] = tile.albedo[at[0].start - 3, at[1]], 0.8, GLASS
    for x in (dx, dx + door_w):
        tile.box(x - 0.045, glass_top, x + 0.045, h, wood * 1.1, FRAME + 0.02)
    tile.box(dx, h - 0.34, dx + door_w, h, wood * 0.9, FRAME)
    tile.box(dx + 0.08, glass_top + 0.42, dx + door_w - 0.08, glass_top + 0.47, wood * 1.1, FRAME)
    rest = (dx + door_w, w - 0.1) if left else (0.1, dx)
    for x in np.linspace(*rest, max(2, round((rest[1] - rest[0]) / 1.2) + 1))[1:-1]:
        tile.box(x - 0.03, glass_top, x + 0.03, glass_end, wood * 1.1, BAR)
    tile.box(rest[0], glass_top + 0.38, rest[1], glass_top + 0.43, wood * 1.1, BAR)
    for x0, y0, x1, y1 in ((0, 0, 0.12, h), (w - 0.12, 0, w, h)):
        tile.box(x0, y0, x1, y1, wood * 1.12, 0.02)
    for x in np.linspace(*rest, max(2, round((rest[1] - rest[0]) / 0.7) + 1))[:-1]:
        tile.box(x + 0.10, glass_end + 0.10, x + 0.58, h - 0.10, wood * 1.25, -0.03)
    _sign(tile, sign, ground, ink, word, rng)
    if state != "awning":
        return tile, None
    return tile, _awning(tile, sign, scheme)


def _display(tile: Canvas, x0: float, y0: float, x1: float, y1: float, rng: np.random.Generator) -> None:
    """The shop window: a warm dim room with goods on two shelves, under what the glass mirrors."""
    at = tile.region(x0, y0, x1, y1)
    shape = tile.relief[at].shape
    rows, columns = shape
    glow = np.linspace(1.3, 0.6, rows, dtype=np.float32)[:, None] * (1 + 0.15 * noise(shape, columns / 4, rng))
    room = linear("#7a6248") * (0.75 * glow)[..., None]
    goods = linear("#c8a070"), linear("#8a4a3c"), linear("#5f7a6a"), linear("#d9cfae"), linear("#47586e")
    for shelf in (0.62, 0.97):
        x = 0.04 * columns
        while x < 0.95 * columns:
            wide, tall = rng.uniform(0.10, 0.26) * tile.scale, rng.uniform(0.10, 0.30) * rows
            top = max(0, round(shelf * rows - tall))
            tone = goods[int(rng.integers(len(goods)))] * rng.uniform(0.35, 0.8)
            room[top : round(shelf * rows), round(x) : round(x + wide)] = tone
            x += wide + rng.uniform(0.04, 0.22) * tile.scale
        room[round(shelf * rows) : round(shelf * rows) + max(1, tile.px(0.03))] *= 0.45
    tile.albedo[at] = 0.80 * room + 0.24 * mirrored(shape, rng, horizon=0.45)
    tile.relief[at] = GLASS
    tile.gloss[at] = 1.0


def _sign(tile: Canvas, tall: float, ground: np.ndarray, ink: np.ndarray, word: str, rng: np.random.Generator) -> None:
    w = tile.width_m
    tile.moulding(0, 0, w, tall, ground, (0.14, 0.14, 0.06, 0.06, 0.06, 0.06, 0.06, 0.06, 0.06, 0.10))
    at = tile.region(0.15, 0.16 * tall, w - 0.15, 0.94 * tall)
    rows, columns = tile.relief[at].shape
    letters = np.zeros((rows, columns), np.uint8)
    font = cv2.FONT_HERSHEY_DUPLEX if rng.random() < 0.5 else cv2.FONT_HERSHEY_COMPLEX
    (text_w, text_h), _ = cv2.getTextSize(word, font, 1.0, 1)
    size = min(0.62 * rows / text_h, 0.9 * columns / text_w)
    thick = max(1, round(0.13 * size * text_h))
    where = (round((columns - size * text_w) / 2), round((rows + size * text_h) / 2))
    cv2.putText(letters, word, where, font, size, 1, thick, cv2.LINE_8)
    tile.albedo[at][letters > 0] = ink
    tile.relief[at][letters > 0] += 0.02


def _awning(tile: Canvas, sign: float, scheme: int) -> Plate:
    """A striped or plain awning with a scalloped edge, seen from the front: it hides the upper part of the glass."""
    rows, columns = tile.px(min(1.05, 0.34 * tile.height_m)), tile.relief.shape[1]
    first, second = (linear(c) for c in AWNINGS[_AWNING_OF[scheme % len(SIGN_COLOURS)]])
    count = max(5, round(tile.width_m / 0.32)) | 1
    x = (np.arange(columns) + 0.5) / columns * count
    y = ((np.arange(rows) + 0.5) / rows)[:, None]
    stripe = ((x.astype(int) % 2 == 0) | (scheme % 3 > 0))[None, :, None]
    valance = y > 0.78
    light = np.where(valance, 0.72, 1.12 - 0.22 * y) * (1 + 0.04 * np.cos(2 * np.pi * x))
    colour = np.where(stripe, first, second) * light[..., None]
    scallop = 0.90 + 0.10 * np.sqrt(np.clip(1 - (2 * (x % 1) - 1) ** 2, 0, 1))
    alpha = (y <= scallop).astype(np.float32)
    return Plate(colour.astype(np.float32), alpha, tile.px(sign), 0, 0.75, hinged=True)
