"""Windows as tiles: mirrored sky, the room with its blinds or curtains, and the frame in front."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facade_core.synth.canvas import Canvas, blur, linear, noise

GLASS, BAR, FRAME = -0.27, -0.23, -0.20  # relief in metres
_SKY_HIGH, _SKY_LOW, _STREET = linear("#8fb4df"), linear("#e6ecee"), linear("#837a70")
_ROOM = linear("#2a2c30")


@dataclass(frozen=True)
class Fabrics:
    """One household taste per house: frame, curtain and blind colours in linear light."""

    frame: np.ndarray
    curtain: np.ndarray
    blind: np.ndarray


def window_tile(
    shape: tuple[int, int],
    scale: float,
    glazing: str,
    kind: str,
    state: str,
    fabrics: Fabrics,
    rng: np.random.Generator,
) -> tuple[Canvas, np.ndarray | None]:
    """A window of `shape` raster pixels in one state, and the mask of its opening where that is not the whole box."""
    tile = Canvas.blank(*shape, scale)
    tile.relief[:] = GLASS
    inside = _room(shape, state, fabrics, scale, rng)
    tile.albedo[:] = 0.64 * inside + 0.50 * mirrored(shape, rng)
    tile.gloss[:] = 1.0
    _frame(tile, "dormer" if kind == "dormer" else glazing, kind, fabrics.frame)
    if kind != "arched":
        return tile, None
    rows, columns = shape
    across = (np.arange(columns) + 0.5) / columns * 2 - 1
    spring = 0.20 * columns * across**2
    below = np.arange(rows)[:, None] - spring
    rim = (below >= 0) & (below < tile.px(0.085))
    tile.albedo[rim] = fabrics.frame
    tile.gloss[rim] = 0
    tile.relief[rim] = FRAME
    return tile, below >= 0


def mirrored(shape: tuple[int, int], rng: np.random.Generator, horizon: float = 0.68) -> np.ndarray:
    """What a pane mirrors (H, W, 3): sky paling towards the roofs across the street, and those roofs below."""
    rows, columns = shape
    horizon = horizon + float(rng.uniform(-0.06, 0.1))
    y = ((np.arange(rows, dtype=np.float32) + 0.5) / rows)[:, None]
    x = ((np.arange(columns, dtype=np.float32) + 0.5) / columns)[None, :]
    down = np.clip(y / horizon, 0, 1) ** 1.2 + np.zeros_like(x)
    cloud = np.clip(0.5 + 2.2 * (0.55 - np.abs(x * 0.8 + y - 0.75)) * 0.6, 0, 1) * 0.35
    sky = _SKY_HIGH + (_SKY_LOW - _SKY_HIGH) * np.clip(down + cloud, 0, 1)[..., None]
    roofs = horizon + 0.07 * np.repeat(rng.random(4).astype(np.float32), -(-columns // 4))[:columns]
    street = np.clip((y - roofs) * 14, 0, 1)[..., None]
    depth = 1 - 0.35 * np.clip((y - horizon) / (1 - horizon), 0, 1)
    # Panes that lean in or out mirror less or more of the sky.
    lean = np.float32(rng.uniform(0.78, 1.0))
    return lean * (sky * (1 - 0.75 * street) + _STREET * (0.75 * street * depth[..., None]))


def _room(shape: tuple[int, int], state: str, fabrics: Fabrics, scale: float, rng: np.random.Generator) -> np.ndarray:
    rows, columns = shape
    y = ((np.arange(rows, dtype=np.float32) + 0.5) / rows)[:, None]
    x = ((np.arange(columns, dtype=np.float32) + 0.5) / columns)[None, :]
    room = _ROOM * (0.7 + 0.8 * y[..., None] + 0.25 * noise(shape, 0.25 * scale, rng)[..., None].clip(-1, 1))
    if state.startswith("curtains"):
        folds = 0.80 + 0.20 * np.sin(2 * np.pi * x * columns / (0.17 * scale) + 0.9 * np.sin(3 * y))
        cloth = fabrics.curtain * (folds * (1.02 - 0.18 * y))[..., None]
        if state == "curtains-drawn":
            # A sliver stays open in the middle, as curtains are drawn by hand.
            cover = np.clip((np.abs(x - 0.5) - 0.015 - 0.02 * y) * columns / 2, 0, 1)
        else:
            # Tall windows have tied drapes, broad ones hang straight.
            tie = 0.12 if rows > 1.35 * columns else 0.0
            drape = (
                (0.29 if tie else 0.2) * float(rng.uniform(0.75, 1.15))
                - tie * np.exp(-(((y - 0.68) / 0.24) ** 2))
                + 0.02 * y
            )
            cover = np.clip((np.abs(x - 0.5) - (0.5 - drape)) * columns / 2, 0, 1)
        # A net curtain veils the whole window behind.
        room = room * 0.75 + linear("#d8d8d2") * 0.10
        return room + cover[..., None] * (cloth - room)
    if state.startswith("blind"):
        reach = float(rng.uniform(0.42, 0.62)) if state == "blind-half" else 1.0
        slats = 0.86 + 0.14 * np.sin(2 * np.pi * y * rows / max(4.0, 0.12 * scale))
        cover = np.clip((reach - y) * rows / 2, 0, 1) + np.zeros_like(x)
        edge = np.exp(-(((reach - y) * rows / (0.03 * scale)) ** 2)) * (reach < 1)
        cloth = fabrics.blind * (slats * (0.9 + 0.1 * x) * (1 - 0.45 * edge))[..., None]
        return room + cover[..., None] * (cloth - room)
    return room


def _frame(tile: Canvas, glazing: str, kind: str, colour: np.ndarray) -> None:
    w, h = tile.width_m, tile.height_m
    foot = 0.0
    if kind == "door" and glazing not in ("french",):
        foot = min(0.55, 0.22 * h)
        tile.box(0, h - foot, w, h, colour * 0.92, FRAME)
        tile.box(0.16, h - foot + 0.12, w - 0.16, h - 0.12, colour * 0.82, BAR)
    transom, sashes, upper, rows = {
        "jugend": (0.36, 3 if w > 1.45 else 2, 2, 1),
        "cross": (0.30, 2, 1, 2),
        "sash": (0.33, 2, 1, 2),
        "strip": (0.0, max(2, round(w / 0.95)), 1, 1),
        "french": (0.20, 2, 1, 3),
        "dormer": (0.0, 2, 1, 2),
        "grid": (0.0, 2, 1, 3),
        "deco": (0.24, 3, 1, 1),
        "picture": (0.0, 2, 1, 1),
    }[glazing]
    edge, bar, thin = 0.075, 0.065, 0.034
    light = (h - foot) * transom
    posts = np.linspace(0, w, sashes + 1)[1:-1]
    if glazing in ("strip", "picture"):
        # One narrow casement to air the room beside the broad lights.
        posts = np.array([min(0.5, 0.3 * w), *np.linspace(min(0.5, 0.3 * w), w, sashes)[1:-1]])
    for x in posts:
        tile.box(x - bar / 2, light, x + bar / 2, h - foot, colour, FRAME)
    if transom:
        for x in np.linspace(0, w, sashes * upper + 1)[1:-1]:
            tile.box(x - thin / 2, 0, x + thin / 2, light, colour, BAR)
        if glazing == "jugend":
            tile.box(0, light / 2 - thin / 2, w, light / 2 + thin / 2, colour, BAR)
        tile.box(0, light - 0.05, w, light + 0.05, colour, FRAME + 0.02)
    for y in np.linspace(light, h - foot, rows + 1)[1:-1]:
        tile.box(0, y - thin / 2, w, y + thin / 2, colour, BAR)
    for x0, y0, x1, y1 in ((0, 0, edge, h), (w - edge, 0, w, h), (0, 0, w, edge), (0, h - edge * 1.3, w, h)):
        tile.box(x0, y0, x1, y1, colour, FRAME)


def panes_differ(tile: Canvas, rng: np.random.Generator) -> Canvas:
    """The same window once more: old glass never mirrors quite the same light twice."""
    strength = np.float32(0.035 * rng.standard_normal())
    wave = 0.02 * blur(rng.standard_normal(tile.relief.shape, dtype=np.float32), 0.12 * tile.scale) * 0.12 * tile.scale
    albedo = tile.albedo * (1 + tile.gloss * (strength + wave))[..., None]
    return Canvas(albedo, tile.relief, tile.gloss, tile.scale)
