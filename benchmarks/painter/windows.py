"""Windows as canvas tiles: reflections, a room with blinds or curtains, and the frame in front."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.painter.canvas import Canvas, hex_to_linear, smooth_noise
from facade_core.core.arrays import BoolArray, Float32Array

# Relief of glass, glazing bars and frames, metres in front of the wall plane.
GLASS_RELIEF_M = -0.27
BAR_RELIEF_M = -0.23
FRAME_RELIEF_M = -0.20
# Reflections in linear light: the sky, and the walls and panes of the buildings across the street.
_UPPER_SKY = 0.24 * hex_to_linear("#a9c3e2")
_LOWER_SKY = 0.35 * hex_to_linear("#eef0ee")
_COATED_GLASS = 0.16 * hex_to_linear("#86aecb")  # coated panes of offices reflect more of the sky
_OPPOSITE_PANES = hex_to_linear("#3b3a39")
_OPPOSITE_WALLS = hex_to_linear("#4a4743")
_ROOM = hex_to_linear("#35353a")
# Probabilities that a casement reflects the sky, in the lower and the upper half of a facade.
LOW_FLOOR_SKY_PROBABILITY = 0.12
HIGH_FLOOR_SKY_PROBABILITY = 0.45


@dataclass(frozen=True)
class WindowColours:
    """Colours of a building's windows, (3,) in linear light.

    Attributes
    ----------
    frame, curtain, blind : colour of each part.
    """

    frame: Float32Array
    curtain: Float32Array
    blind: Float32Array


def paint_window_tile(
    shape: tuple[int, int],
    scale: float,
    glazing: str,
    kind: str,
    state: str,
    fabrics: WindowColours,
    sky: float,
    rng: np.random.Generator,
) -> tuple[Canvas, BoolArray | None]:
    """Paint a window in one state.

    Parameters
    ----------
    shape : rows and columns of the tile.
    scale : raster pixels per metre.
    glazing : division of the frame, as of `FacadeStyle.glazing`.
    kind : variant of the window, such as "arched" or "dormer".
    state : such as "blind-half".
    fabrics : colours of frame, curtains and blinds.
    sky : probability that a casement reflects the sky.
    rng : source of randomness.

    Returns
    -------
    tile : the window.
    mask : (h, w) bool of its opening; None for the whole box.
    """
    tile = Canvas.blank(*shape, scale)
    tile.relief[:] = GLASS_RELIEF_M
    tile.albedo[:] = _room_colours(shape, state, fabrics, scale, rng)
    division = "dormer" if kind == "dormer" else glazing
    tile.albedo += glass_reflections(
        shape, rng, posts=[tile.to_pixels(x) for x in _post_positions(division, tile.width_m)], sky=sky
    )
    if glazing == "curtain":
        tile.albedo += _COATED_GLASS
    tile.gloss[:] = 1.0
    _paint_frame(tile, division, kind, fabrics.frame)
    if kind != "arched":
        return tile, None
    rows, columns = shape
    across = (np.arange(columns) + 0.5) / columns * 2 - 1
    spring = 0.20 * columns * across**2
    below = np.arange(rows)[:, None] - spring
    rim = (below >= 0) & (below < tile.to_pixels(0.085))
    tile.albedo[rim] = fabrics.frame
    tile.gloss[rim] = 0
    tile.relief[rim] = FRAME_RELIEF_M
    return tile, below >= 0


def glass_reflections(
    shape: tuple[int, int], rng: np.random.Generator, *, posts: Sequence[int], sky: float
) -> Float32Array:
    """Paint the reflections in panes: shaded buildings across the street, and the sky over their eaves in some leaves.

    Parameters
    ----------
    shape : rows and columns.
    rng : source of randomness.
    posts : columns between casements, each of which tilts differently.
    sky : probability that a casement reflects the sky.

    Returns
    -------
    light : (H, W, 3) linear light.
    """
    rows, columns = shape
    y = ((np.arange(rows, dtype=np.float32) + 0.5) / rows)[:, None]
    light = np.empty((rows, columns, 3), np.float32)
    low, tone, wide = float(rng.uniform(0.25, 1.3)), float(rng.uniform(0.4, 0.85)), float(rng.uniform(0.45, 0.7))
    for left, right in zip((0, *posts), (*posts, columns), strict=True):
        x = (np.arange(right - left, dtype=np.float32) + 0.5)[None, :] / max(columns, 1)
        # each leaf tilts differently, which shifts and shears its blurred reflection
        lift, lean = rng.uniform(-0.12, 0.12), rng.uniform(-0.12, 0.12)
        at = y + lift + lean * x
        panes = np.clip(4 * np.cos(2 * np.pi * (at - low) / 0.62) - 1.2, 0, 1) * np.clip(
            4 * np.cos(2 * np.pi * (x + rng.random()) / wide) - 0.6, 0, 1
        )
        houses = rng.uniform(0.6, 1.1) * (
            _OPPOSITE_WALLS * tone + panes[..., None] * (0.45 * _OPPOSITE_PANES - _OPPOSITE_WALLS * tone)
        )
        eaves = low + lift if rng.random() < sky else -1.0
        above = np.clip((eaves - at) * (rows / 4), 0, 1)[..., None]
        sky_colour = _UPPER_SKY + (_LOWER_SKY - _UPPER_SKY) * np.clip(at / 1.1, 0, 1)[..., None]
        light[:, left:right] = houses + above * (rng.uniform(0.55, 1.0) * sky_colour - houses)
    return light


def _room_colours(
    shape: tuple[int, int], state: str, fabrics: WindowColours, scale: float, rng: np.random.Generator
) -> Float32Array:
    """Return the dim room behind the glass with its curtains or blinds."""
    rows, columns = shape
    y = ((np.arange(rows, dtype=np.float32) + 0.5) / rows)[:, None]
    x = ((np.arange(columns, dtype=np.float32) + 0.5) / columns)[None, :]
    depth = np.float32(rng.uniform(0.5, 1.1)) * (
        0.75 + 0.5 * y + 0.3 * smooth_noise(shape, 0.3 * scale, rng).clip(-1, 1)
    )
    room = _ROOM * depth[..., None]
    if state.startswith("curtains"):
        # Behind glass and a reveal, cloth is always darker than the wall.
        light = float(rng.uniform(0.5, 0.75))
        folds = 0.72 + 0.28 * np.sin(2 * np.pi * x * columns / (rng.uniform(0.10, 0.2) * scale) + 0.9 * np.sin(3 * y))
        cloth = light * fabrics.curtain * (folds * (1.05 - 0.35 * y))[..., None]
        if state == "curtains-drawn":
            # A sliver stays open, as curtains are drawn by hand.
            middle = float(rng.uniform(0.35, 0.65))
            cover = np.clip((np.abs(x - middle) - 0.015 - 0.03 * y) * columns / 2, 0, 1)
        else:
            # Tall windows have tied drapes, broad ones hang straight; no two sides alike.
            tie = 0.12 if rows > 1.35 * columns else 0.0
            drape = (0.26 if tie else 0.18) - tie * np.exp(-(((y - 0.68) / 0.24) ** 2)) + 0.02 * y
            sides = rng.uniform(0.7, 1.25, 2).astype(np.float32)
            wide = drape * np.where(x < 0.5, sides[0], sides[1])
            cover = np.clip((np.abs(x - 0.5) - (0.5 - wide)) * columns / 2, 0, 1)
        return np.asarray(room + cover[..., None] * (cloth - room), np.float32)
    if state.startswith("blind"):
        reach = float(rng.uniform(0.25, 0.62)) if state == "blind-half" else 1.0
        slats = 0.80 + 0.20 * np.sin(2 * np.pi * y * rows / max(4.0, 0.07 * scale))
        cover = np.clip((reach - y) * rows / 2, 0, 1) + np.zeros_like(x)
        edge = np.exp(-(((reach - y) * rows / (0.03 * scale)) ** 2)) * (reach < 1)
        cloth = 0.7 * fabrics.blind * (slats * (0.9 + 0.1 * x) * (1 - 0.45 * edge))[..., None]
        return np.asarray(room + cover[..., None] * (cloth - room), np.float32)
    return np.asarray(room, np.float32)


def _paint_frame(tile: Canvas, glazing: str, kind: str, colour: Float32Array) -> None:
    w, h = tile.width_m, tile.height_m
    foot = 0.0
    if kind == "door" and glazing not in ("french",):
        foot = min(0.55, 0.22 * h)
        tile.fill_box(0, h - foot, w, h, colour * 0.92, FRAME_RELIEF_M)
        tile.fill_box(0.16, h - foot + 0.12, w - 0.16, h - 0.12, colour * 0.82, BAR_RELIEF_M)
    transom, upper, rows = {
        "jugend": (0.36, 2, 1),
        "cross": (0.30, 1, 2),
        "sash": (0.33, 1, 2),
        "strip": (0.0, 1, 1),
        "french": (0.20, 1, 3),
        "dormer": (0.0, 1, 2),
        "grid": (0.0, 1, 3),
        "deco": (0.24, 1, 1),
        "picture": (0.0, 1, 1),
        "curtain": (0.0, 1, 1),
    }[glazing]
    edge, bar, thin = 0.075, 0.065, 0.034
    light = (h - foot) * transom
    posts = _post_positions(glazing, w)
    for x in posts:
        tile.fill_box(x - bar / 2, light, x + bar / 2, h - foot, colour, FRAME_RELIEF_M)
    if transom:
        for x in np.linspace(0, w, (len(posts) + 1) * upper + 1)[1:-1]:
            tile.fill_box(x - thin / 2, 0, x + thin / 2, light, colour, BAR_RELIEF_M)
        if glazing == "jugend":
            tile.fill_box(0, light / 2 - thin / 2, w, light / 2 + thin / 2, colour, BAR_RELIEF_M)
        tile.fill_box(0, light - 0.05, w, light + 0.05, colour, FRAME_RELIEF_M + 0.02)
    for y in np.linspace(light, h - foot, rows + 1)[1:-1]:
        tile.fill_box(0, y - thin / 2, w, y + thin / 2, colour, BAR_RELIEF_M)
    for x0, y0, x1, y1 in ((0, 0, edge, h), (w - edge, 0, w, h), (0, 0, w, edge), (0, h - edge * 1.3, w, h)):
        tile.fill_box(x0, y0, x1, y1, colour, FRAME_RELIEF_M)


def _post_positions(glazing: str, w: float) -> list[float]:
    """Return x of the posts between casements in metres."""
    sashes = {
        "jugend": 3 if w > 1.45 else 2,
        "strip": max(2, round(w / 0.95)),
        "deco": 3,
        "curtain": max(1, round(w / 1.25)),
    }.get(glazing, 2)
    if glazing in ("strip", "picture"):
        # One narrow casement for ventilation next to the wide lights.
        narrow = min(0.5, 0.3 * w)
        return [narrow, *np.linspace(narrow, w, sashes)[1:-1].tolist()]
    return list(np.linspace(0, w, sashes + 1)[1:-1].tolist())


def vary_pane_brightness(tile: Canvas, rng: np.random.Generator) -> Canvas:
    """Return the window with panes of another random brightness."""
    strength = np.float32(np.exp(0.10 * rng.standard_normal()) - 1)
    return Canvas(tile.albedo * (1 + tile.gloss * strength)[..., None], tile.relief, tile.gloss, tile.scale)
