"""Shop fronts as canvas tiles: two or three bays per shop with its name, door and goods behind the glass."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from benchmarks.painter.canvas import Canvas, WallAttachment, fractal_noise, hex_to_linear, smooth_noise
from benchmarks.painter.windows import BAR_RELIEF_M, FRAME_RELIEF_M, GLASS_RELIEF_M, glass_reflections
from facade_core.core.arrays import Float32Array, Float64Array

# Names of shops by the goods behind their glass.
SHOP_NAMES = {
    "shelves": ("Kirjat", "Paperi", "Lelut", "Rauta", "Radio", "Soitin", "Kemikalio", "Suutari"),
    "clothes": ("Hatut", "Kangas", "Turkis", "Puku", "Asuste", "Neule"),
    "flowers": ("Kukka", "Blommor", "Kukat", "Siemen"),
    "counter": ("Kahvila", "Bageri", "Leipomo", "Herkku", "Viini", "Parturi", "Kahvi", "Konditoria"),
    "posters": ("Apteekki", "Matkat", "Optikko", "Pesula", "Kello", "Arpa"),
    "lamps": ("Valaisin", "Galleria", "Taide", "Matto", "Antik", "Tapetti"),
}
# Board and letters.
SIGN_COLOURS = (
    ("#2c3a36", "#cfc6a4"),
    ("#2e3442", "#d4d0c6"),
    ("#54302c", "#d8cbac"),
    ("#26282a", "#c9ad6a"),
    ("#cfc8b8", "#3c2c28"),
    ("#45525a", "#dcdad4"),
    ("#d8d6d0", "#2a3a52"),
    ("#3a3a3c", "#e2e0dc"),
    ("#8c8a84", "#26282a"),
    ("#4c4a3c", "#d6d0b8"),
)
AWNING_COLOURS = ("#5a3a36", "#3a4a42", "#3c4658", "#8a8474", "#b4ac9c", "#6a6c6e")
_GOODS_COLOURS = ("#a98a62", "#6e4238", "#50665a", "#b4aa90", "#3e4c5e", "#8c8c88", "#33312f", "#7a6a72")


@dataclass(frozen=True)
class ShopDesign:
    """Properties that the bays of a shop share.

    Attributes
    ----------
    name : text of the sign.
    colours : '#rrggbb' of sign and letters.
    awning : '#rrggbb' of the awning.
    is_striped : the awning has stripes.
    fascia, transom, riser : heights in metres; 0 for no transom.
    has_stone_base : the riser is of stone, else of wooden panels.
    font : font number of OpenCV.
    goods : key of SHOP_NAMES.
    """

    name: str
    colours: tuple[str, str]
    awning: str
    is_striped: bool
    fascia: float
    transom: float
    riser: float
    has_stone_base: bool
    font: int
    goods: str


def design_shops(count: int, rng: np.random.Generator) -> list[ShopDesign]:
    """Design a row of shops with unique names; neighbours differ in colours and goods."""
    schemes, wares = rng.permutation(len(SIGN_COLOURS)), rng.permutation(list(SHOP_NAMES))
    names = {goods: rng.permutation(options) for goods, options in SHOP_NAMES.items()}
    fonts = (cv2.FONT_HERSHEY_DUPLEX, cv2.FONT_HERSHEY_COMPLEX, cv2.FONT_HERSHEY_TRIPLEX, cv2.FONT_HERSHEY_SIMPLEX)
    shops = []
    for i in range(count):
        goods = str(wares[i % len(wares)])
        name = str(names[goods][i // len(wares) % len(names[goods])])
        shops.append(
            ShopDesign(
                name=name.upper() if rng.random() < 0.6 else name,
                colours=SIGN_COLOURS[schemes[i % len(schemes)]],
                awning=AWNING_COLOURS[int(rng.integers(len(AWNING_COLOURS)))],
                is_striped=bool(rng.random() < 0.3),
                fascia=float(rng.uniform(0.34, 0.66)),
                transom=float(rng.choice([0.0, 0.4, 0.55])),
                riser=float(rng.uniform(0.3, 0.6)),
                has_stone_base=bool(rng.random() < 0.5),
                font=fonts[int(rng.integers(len(fonts)))],
                goods=goods,
            )
        )
    return shops


def paint_shop_bay_tile(
    shape: tuple[int, int],
    scale: float,
    state: str,
    shop: ShopDesign,
    *,
    has_name: bool,
    has_door: bool,
    stone: Float32Array,
    rng: np.random.Generator,
) -> tuple[Canvas, WallAttachment | None]:
    """Paint one bay of a shop.

    Parameters
    ----------
    shape : rows and columns of the tile.
    scale : raster pixels per metre.
    state : "awning" for an extended awning.
    shop : design of the shop.
    has_name : the sign shows the name.
    has_door : the bay has the entrance.
    stone : (3,) linear light of the base.
    rng : source of randomness.

    Returns
    -------
    tile : the bay.
    awning : plate relative to the tile; None without an awning.
    """
    tile = Canvas.blank(*shape, scale)
    w, h = tile.width_m, tile.height_m
    ground, ink = (hex_to_linear(c) for c in shop.colours)
    fascia, riser = min(shop.fascia, 0.19 * h), min(shop.riser, 0.15 * h)
    wood = ground if float(ground.max()) < 0.3 else hex_to_linear("#3c3833")
    tile.albedo[:] = wood
    tile.relief[:] = -0.06
    top, foot = fascia + 0.10, h - riser
    _paint_shop_window(tile, 0.08, top, w - 0.08, foot, shop.goods, rng)
    glazed = (0.08, w - 0.08)
    if has_door:
        wide = min(0.95, 0.4 * w)
        left = bool(rng.random() < 0.5)
        x = 0.14 if left else w - 0.14 - wide
        _paint_shop_door(tile, x, top, x + wide, wood)
        glazed = (x + wide, glazed[1]) if left else (glazed[0], x)
    if shop.has_stone_base:
        tile.fill_box(glazed[0], foot, glazed[1], h, stone * 0.8, 0.0)
        tile.add_moulding(glazed[0], foot - 0.04, glazed[1], foot + 0.05, stone, (0.05, 0.05, 0.02))
    else:
        tile.add_moulding(glazed[0], foot - 0.03, glazed[1], foot + 0.05, wood * 1.15, (0.03, 0.03, 0.0))
        for x in np.linspace(*glazed, max(2, round((glazed[1] - glazed[0]) / 0.7) + 1))[:-1]:
            tile.fill_box(x + 0.10, foot + 0.12, min(x + 0.58, glazed[1] - 0.05), h - 0.10, wood * 1.3, -0.03)
    for x in np.linspace(*glazed, max(2, round((glazed[1] - glazed[0]) / 1.6) + 1))[1:-1]:
        tile.fill_box(x - 0.025, top, x + 0.025, foot, wood * 1.1, BAR_RELIEF_M)
    if shop.transom:
        tile.fill_box(glazed[0], top + shop.transom, glazed[1], top + shop.transom + 0.05, wood * 1.1, FRAME_RELIEF_M)
    for x0, y0, x1, y1 in ((0, 0, 0.09, h), (w - 0.09, 0, w, h), (0, fascia, w, top)):
        tile.fill_box(x0, y0, x1, y1, wood * 1.12, 0.0)
    _paint_fascia(tile, fascia, ground, ink, shop if has_name else None, rng)
    if state != "awning":
        return tile, None
    return tile, _awning_plate(tile, top, shop)


def _paint_shop_door(tile: Canvas, x0: float, top: float, x1: float, wood: Float32Array) -> None:
    """Paint a glazed, recessed door on a step."""
    h = tile.height_m
    head = min(top + 0.45, 0.5 * (top + h))
    at = tile.region(x0, head, x1, h - 0.30)
    tile.albedo[at] *= 0.6
    tile.albedo[tile.region(x0, h - 0.9, x1, h - 0.30)] = 0.6 * hex_to_linear("#35353a")
    tile.gloss[at], tile.relief[at] = 0.8, GLASS_RELIEF_M - 0.1
    for x in (x0, x1):
        tile.fill_box(x - 0.045, top, x + 0.045, h, wood * 1.1, FRAME_RELIEF_M + 0.02)
    tile.fill_box(x0, h - 0.34, x1, h - 0.08, wood * 0.9, FRAME_RELIEF_M - 0.1)
    tile.fill_box(x0, h - 0.08, x1, h, hex_to_linear("#77736c"), -0.05)
    tile.fill_box(x0, head, x1, head + 0.07, wood * 1.1, FRAME_RELIEF_M)
    tile.fill_box(x1 - 0.13, h - 1.25, x1 - 0.09, h - 0.85, hex_to_linear("#8f8a7c"), -0.16)


def _paint_shop_window(
    tile: Canvas, x0: float, y0: float, x1: float, y1: float, goods: str, rng: np.random.Generator
) -> None:
    """Paint a dim room with goods under the reflections of the glass."""
    at = tile.region(x0, y0, x1, y1)
    shape = tile.relief[at].shape
    rows, columns = shape
    glow = np.linspace(0.7, 1.2, rows, dtype=np.float32)[:, None] * (1 + 0.25 * smooth_noise(shape, columns / 4, rng))
    light = float(rng.uniform(0.55, 1.0))
    room = (hex_to_linear("#463c32") if goods in ("counter", "lamps", "shelves") else hex_to_linear("#3a3a3b")) * glow[
        ..., None
    ]
    room = np.ascontiguousarray(room, np.float32)
    _GOODS_PAINTERS[goods](room, tile.scale, rng)
    tile.albedo[at] = light * room + glass_reflections(shape, rng, posts=(), sky=0.15)
    tile.relief[at] = GLASS_RELIEF_M
    tile.gloss[at] = 1.0


def _draw_goods_colour(rng: np.random.Generator) -> Float32Array:
    return hex_to_linear(_GOODS_COLOURS[int(rng.integers(len(_GOODS_COLOURS)))]) * np.float32(rng.uniform(0.4, 1.0))


def _paint_shelves(room: Float32Array, scale: float, rng: np.random.Generator) -> None:
    """Paint boxes of all sizes on two partly filled shelves."""
    rows, columns = room.shape[:2]
    for shelf in rng.uniform(0.5, 0.68), 0.98:
        y, x = round(shelf * rows), 0.04 * columns
        while x < 0.93 * columns:
            wide, tall = rng.uniform(0.08, 0.5) * scale, rng.uniform(0.06, 0.5) * scale
            if rng.random() < 0.7:
                room[max(0, round(y - tall)) : y, round(x) : round(x + wide)] = _draw_goods_colour(rng)
            x += wide + rng.uniform(0.02, 0.4) * scale
        room[y : y + max(1, round(0.03 * scale))] *= 0.4


def _paint_clothes(room: Float32Array, scale: float, rng: np.random.Generator) -> None:
    """Paint coats and dresses on stands, before a plain screen."""
    rows, columns = room.shape[:2]
    room[round(0.1 * rows) :, round(0.05 * columns) : round(0.95 * columns)] *= np.float32(rng.uniform(0.6, 2.2))
    unit = 0.26 * scale
    x = rng.uniform(0.3, 0.8) * scale
    while x < columns - 0.3 * scale:
        foot, tone, half = rows - 0.05 * scale, _draw_goods_colour(rng), rng.uniform(0.7, 1.1) * unit
        top = max(foot - rng.uniform(1.2, 1.45) * scale, 0.1 * unit)
        hem = top + rng.uniform(0.45, 0.75) * (foot - top)
        outline = ((0.22, 0.0), (0.85, 0.12), (0.95, 0.5), (0.6, 0.55), (rng.uniform(0.6, 1.0), 1.0))
        coat = [(x + side * half * a, top + b * (hem - top)) for side in (1, -1) for a, b in outline[::side]]
        stand = (round(x - 0.02 * scale), round(hem)), (round(x + 0.02 * scale), round(foot))
        cv2.rectangle(room, *stand, (0.05, 0.05, 0.05), -1)
        _paint_garment(room, np.array(coat), tone)
        x += rng.uniform(0.6, 1.3) * scale


def _paint_garment(room: Float32Array, outline: Float64Array, tone: Float32Array) -> None:
    """Paint cloth of one tone with folds inside an outline (k, 2), with an antialiased edge."""
    cover = np.zeros(room.shape[:2], np.uint8)
    cv2.fillPoly(cover, [np.round(outline * 16).astype(np.int32)], 255, cv2.LINE_AA, shift=4)
    (left, _), (right, _) = outline.min(axis=0), outline.max(axis=0)
    across = (np.arange(room.shape[1], dtype=np.float32) - (left + right) / 2) / max(1.0, (right - left) / 2)
    light = 1.05 - 0.35 * across**2 + 0.12 * np.sin(9.0 * across)
    share = cover[..., None] / np.float32(255)
    room[:] = share * np.clip(light, 0.4, 1.2)[:, None] * tone + (1 - share) * room


def _paint_flowers(room: Float32Array, scale: float, rng: np.random.Generator) -> None:
    """Paint leaves and blossom in buckets, denser towards the floor."""
    shape = room.shape[:2]
    rise = np.linspace(-6.0, 2.0, shape[0], dtype=np.float32)[:, None]
    leaves = fractal_noise(shape, 0.3 * scale, 3, rng) + rise > 0
    tone = np.clip(0.6 + 0.4 * smooth_noise(shape, 0.06 * scale, rng), 0.1, 1.6)[..., None]
    room[leaves] = (hex_to_linear("#4c5e3c") * tone)[leaves]
    for colour in ("#b05a58", "#c2a050", "#c8b8c0"):
        spots = leaves & (smooth_noise(shape, 0.09 * scale, rng) > 1.5)
        room[spots] = (hex_to_linear(colour) * tone)[spots]


def _paint_counter(room: Float32Array, scale: float, rng: np.random.Generator) -> None:
    """Paint a counter across the room, a board on the wall and lit lamps."""
    rows, columns = room.shape[:2]
    y = max(0, rows - round(rng.uniform(0.6, 0.8) * scale))
    room[y:] = _draw_goods_colour(rng) * 0.5
    room[y : y + max(1, round(0.05 * scale))] = hex_to_linear("#8a7a64")
    x = round(rng.uniform(0.1, 0.5) * columns)
    board = slice(round(0.3 * rows), round(0.3 * rows) + round(0.6 * scale))
    room[board, x : x + round(0.8 * scale)] = hex_to_linear("#1f2120")
    _paint_ceiling_lights(room, scale, rng)


def _paint_posters(room: Float32Array, scale: float, rng: np.random.Generator) -> None:
    """Paint a screen in the lower part of the window, and sheets of paper before it."""
    rows, columns = room.shape[:2]
    top = round(rng.uniform(0.2, 0.55) * rows)
    room[top:] = hex_to_linear("#a29e94") * np.float32(rng.uniform(0.5, 0.9))
    for _ in range(int(rng.integers(1, 4))):
        wide, tall = rng.uniform(0.3, 0.7) * scale, rng.uniform(0.4, 0.95) * scale
        x, y = rng.uniform(0, max(1.0, columns - wide)), rng.uniform(0.1, 0.5) * rows
        sheet = room[round(y) : round(y + tall), round(x) : round(x + wide)]
        sheet[:] = _draw_goods_colour(rng) * 1.3
        sheet[len(sheet) // 2 : round(0.7 * len(sheet))] *= 0.5


def _paint_lamp_shop(room: Float32Array, scale: float, rng: np.random.Generator) -> None:
    """Paint a deep room with goods on a table and lights far behind."""
    rows, columns = room.shape[:2]
    room *= 0.55
    for _ in range(3):
        wide, tall = rng.uniform(0.4, 1.1) * scale, rng.uniform(0.3, 0.8) * scale
        x = rng.uniform(0, max(1.0, columns - wide))
        room[max(0, round(rows - tall)) :, round(x) : round(x + wide)] = 0.6 * _draw_goods_colour(rng)
    _paint_ceiling_lights(room, scale, rng)


def _paint_ceiling_lights(room: Float32Array, scale: float, rng: np.random.Generator) -> None:
    rows, columns = room.shape[:2]
    y = rng.uniform(0.12, 0.35) * rows
    warm = hex_to_linear("#f2dcae")
    for x in np.arange(rng.uniform(0.2, 0.6) * scale, columns, rng.uniform(0.7, 1.4) * scale):
        cv2.circle(room, (round(x), round(y)), max(1, round(0.06 * scale)), (0.8 * warm).tolist(), -1)


_GOODS_PAINTERS = {
    "shelves": _paint_shelves,
    "clothes": _paint_clothes,
    "flowers": _paint_flowers,
    "counter": _paint_counter,
    "posters": _paint_posters,
    "lamps": _paint_lamp_shop,
}


def _paint_fascia(
    tile: Canvas,
    tall: float,
    ground: Float32Array,
    ink: Float32Array,
    shop: ShopDesign | None,
    rng: np.random.Generator,
) -> None:
    """Paint the board over the glass, with the name if `shop` is given."""
    w = tile.width_m
    tile.add_moulding(0, 0, w, tall, ground, (0.14, 0.14, 0.06, 0.06, 0.06, 0.06, 0.06, 0.06, 0.06, 0.10))
    if shop is None:
        return
    at = tile.region(0.15, 0.16 * tall, w - 0.15, 0.94 * tall)
    rows, columns = tile.relief[at].shape
    word = shop.name
    (text_w, text_h), _ = cv2.getTextSize(word, shop.font, 1.0, 1)
    size = min(float(rng.uniform(0.45, 0.68)) * rows / text_h, 0.85 * columns / text_w)
    thick = max(1, round(float(rng.uniform(0.07, 0.14)) * size * text_h))
    left = int(rng.choice([0.03 * columns, (columns - size * text_w) / 2]))
    letters = np.zeros((rows, columns), np.uint8)
    cv2.putText(letters, word, (left, round((rows + size * text_h) / 2)), shop.font, size, 255, thick, cv2.LINE_AA)
    cover = letters.astype(np.float32)[..., None] / 255
    tile.albedo[at] += cover * (ink - tile.albedo[at])
    tile.relief[at] += 0.02 * cover[..., 0]


def _awning_plate(tile: Canvas, top: float, shop: ShopDesign) -> WallAttachment:
    """Return a shallow awning over the upper part of the glass, which it darkens."""
    tall = min(0.62, 0.2 * tile.height_m)
    rows, columns = tile.to_pixels(tall), tile.relief.shape[1]
    under = tile.region(0, top, tile.width_m, top + tall + 0.7)
    fade = np.clip(np.linspace(0.2, 1.2, under[0].stop - under[0].start, dtype=np.float32), 0.35, 1)
    tile.albedo[under] *= fade[:, None, None]
    first, second = hex_to_linear(shop.awning), hex_to_linear("#c4beb0")
    count = max(5, round(tile.width_m / 0.28)) | 1
    x = (np.arange(columns) + 0.5) / columns * count
    y = ((np.arange(rows) + 0.5) / rows)[:, None]
    stripe = ((x.astype(int) % 2 == 0) | (not shop.is_striped))[None, :, None]
    light = np.where(y > 0.74, 0.62, 1.05 - 0.25 * y) * (1 + 0.05 * np.cos(2 * np.pi * x))
    colour = np.where(stripe, first, second) * light[..., None]
    edge = 0.90 + 0.10 * np.sqrt(np.clip(1 - (2 * (x % 1) - 1) ** 2, 0, 1)) if shop.is_striped else np.ones(columns)
    alpha = (y <= edge).astype(np.float32)
    return WallAttachment(
        colour.astype(np.float32), alpha, tile.to_pixels(top) - max(1, tile.to_pixels(0.04)), 0, 0.5, is_hinged=True
    )
