"""Thin occluders of streets, drawn in metres: posts, signals, signs, wires, bare trees, fences, scaffolds, parasols."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import cv2
import numpy as np

from benchmarks.painter.thin_canvas import (
    RGB,
    ThinCanvas,
    choose_colour,
    composite_canvas,
    jitter_colour,
)
from facade_core.core.arrays import UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.labels import UNKNOWN

_METALS: tuple[RGB, ...] = ((120, 124, 126), (150, 153, 155), (84, 88, 90), (44, 47, 48), (30, 44, 38), (226, 226, 222))
_PAINTS: tuple[RGB, ...] = ((34, 40, 62), (88, 40, 30), (106, 78, 52), (72, 92, 74), (196, 180, 60))
_BARKS: tuple[RGB, ...] = ((74, 66, 58), (96, 90, 80), (54, 48, 44), (112, 104, 92), (86, 92, 70))
_CLOTHS: tuple[RGB, ...] = ((226, 218, 200), (160, 36, 36), (40, 84, 60), (36, 52, 96), (214, 190, 120), (70, 70, 72))
_LIGHTS: tuple[RGB, ...] = ((226, 50, 40), (238, 170, 40), (60, 200, 130))
_DARK: RGB = (26, 28, 30)
_WHITE: RGB = (232, 232, 228)

# Occluders nearer to the camera than the wall are larger by up to this factor,
_MAX_MAGNIFICATION = 4.0
# and their foot is lower, by this camera height.
_CAMERA_HEIGHT_M = 1.8
# Side in metres of the gaps between bars and twigs that count as hidden.
GAP_M = 0.12
# Opacity from which a pixel counts as hidden,
_HIDDEN_OPACITY = 0.35
# and up to which it counts as clear.
_CLEAR_OPACITY = 0.08


class ThinView(NamedTuple):
    """Place of a drawing in a picture.

    Attributes
    ----------
    metres_per_pixel : resolution of the occluders, which stand before the wall.
    foot : row of the ground in pixels; it may be outside the picture.
    """

    metres_per_pixel: float
    foot: float


def paint_before_wall(
    image: UInt8Array, kind: str, metres_per_pixel: float, foot: float, rng: np.random.Generator
) -> tuple[UInt8Array, UInt8Array]:
    """Paint an occluder of a kind at a random place and distance before a wall.

    Parameters
    ----------
    image : (H, W, 3) uint8 RGB, a rectified facade or a part of one.
    kind : key of THIN_KINDS.
    metres_per_pixel : resolution of the wall.
    foot : row of the wall's foot in pixels; it may be outside the picture.
    rng : source of randomness.

    Returns
    -------
    image, occluder : as in `paint_thin_occluder`.
    """
    larger = float(np.exp(rng.uniform(0, np.log(_MAX_MAGNIFICATION))))
    ground = foot + ((larger - 1) * _CAMERA_HEIGHT_M + float(rng.normal(0, 0.3))) / metres_per_pixel
    return paint_thin_occluder(image, kind, ThinView(metres_per_pixel / larger, ground), rng)


def paint_thin_occluder(
    image: UInt8Array, kind: str, view: ThinView, rng: np.random.Generator
) -> tuple[UInt8Array, UInt8Array]:
    """Paint an occluder of a kind at a random place over a picture.

    Parameters
    ----------
    image : (H, W, 3) uint8 RGB.
    kind : key of THIN_KINDS.
    view : place of the drawing.
    rng : source of randomness.

    Returns
    -------
    image : (H, W, 3) uint8.
    occluder : (H, W) uint8; 1 on covered pixels and narrow gaps between them, UNKNOWN on faint ones, else 0.

    Raises
    ------
    ImageError
        If the kind is unknown.
    """
    if kind not in THIN_KINDS:
        raise ImageError(f"{kind}: no thin occluder; name one of {', '.join(THIN_KINDS)}")
    height, width = image.shape[:2]
    canvas = ThinCanvas((height, width), view.metres_per_pixel, view.foot)
    THIN_KINDS[kind](canvas, float(rng.uniform(0.04, 0.96)) * canvas.width_m, rng)
    painted, alpha = composite_canvas(image, canvas, blur=float(rng.uniform(0.0, 0.8)), gain=float(rng.normal(1, 0.15)))
    side = 1 + 2 * round(GAP_M / view.metres_per_pixel / 2)
    solid = np.pad((alpha >= _HIDDEN_OPACITY).astype(np.uint8), side)
    closed = cv2.morphologyEx(solid, cv2.MORPH_CLOSE, np.ones((side, side), np.uint8))
    occluder = np.where(alpha > _CLEAR_OPACITY, UNKNOWN, 0).astype(np.uint8)
    occluder[closed[side:-side, side:-side] > 0] = 1
    return painted, occluder


def _paint_pole(
    canvas: ThinCanvas, x: float, height: float, width: float, rng: np.random.Generator, colour: RGB | None = None
) -> tuple[float, RGB]:
    """Paint a pole with its plinth; returns the position of its top and its colour."""
    tone = jitter_colour(colour or choose_colour((*_METALS, *_METALS, *_PAINTS), rng), rng)
    lean = float(rng.normal(0, 0.008)) * height
    taper = float(rng.uniform(0.55, 1.0))
    canvas.tube([(x, -0.3), (x + lean, height)], (width, width * taper), tone, rng)
    if rng.random() < 0.4:
        canvas.tube([(x, -0.3), (x, float(rng.uniform(0.3, 1.3)))], (1.5 * width, 1.5 * width), tone, rng)
    for _ in range(int(rng.integers(0, 3))):
        y = float(rng.uniform(0.8, max(0.9, min(height, 3.0))))
        band = jitter_colour(choose_colour((*_METALS, *_CLOTHS), rng), rng)
        share, high = y / height, float(rng.uniform(0.04, 0.35))
        canvas.box(x + lean * share, y, width * 1.05, high, band)
    return x + lean, tone


def _paint_post(canvas: ThinCanvas, x: float, rng: np.random.Generator) -> None:
    """Paint posts and lamp posts: bollards, poles, masts with an arm, lanterns."""
    style = rng.choice(["bollard", "pole", "mast", "lantern"], p=[0.15, 0.3, 0.3, 0.25])
    if style == "bollard":
        for number in range(int(rng.integers(1, 4))):
            _paint_pole(canvas, x + 1.6 * number, float(rng.uniform(0.7, 1.3)), float(rng.uniform(0.08, 0.2)), rng)
        return
    height = float(rng.uniform(2.6, 5.0) if style == "lantern" else rng.uniform(3.0, 11.0))
    top, tone = _paint_pole(canvas, x, height, float(rng.uniform(0.07, 0.2)), rng)
    if style == "mast":
        for side in (-1, 1) if rng.random() < 0.3 else (int(rng.choice([-1, 1])),):
            reach, rise = float(rng.uniform(0.4, 2.2)) * side, float(rng.uniform(-0.1, 0.7))
            curve = [(top + reach * t, height + rise * np.sin(t * np.pi / 2)) for t in np.linspace(0, 1, 7)]
            canvas.tube(curve, (0.06, 0.05), tone, rng)
            head = float(rng.uniform(0.35, 0.8)) * side
            end = (top + reach, height + rise)
            canvas.polygon(
                [(end[0] - 0.1 * head, end[1] - 0.04), (end[0], end[1] + 0.09), (end[0] + head, end[1] + 0.05),
                 (end[0] + head, end[1] - 0.06)], tone,
            )  # fmt: skip
    elif style == "lantern":
        low, wide, high = height - 0.05, float(rng.uniform(0.12, 0.24)), float(rng.uniform(0.3, 0.6))
        if rng.random() < 0.4:
            canvas.disc(top, low + high / 2, float(rng.uniform(0.15, 0.28)), jitter_colour(_WHITE, rng))
        else:
            glass = jitter_colour((214, 206, 180), rng)
            canvas.polygon(
                [(top - 0.6 * wide, low), (top + 0.6 * wide, low), (top + wide, low + high), (top - wide, low + high)],
                glass,
            )
            cap = [(top - 1.3 * wide, low + high), (top + 1.3 * wide, low + high), (top, low + 1.5 * high)]
            canvas.polygon(cap, tone)
            for share in (-1, 0, 1):
                canvas.tube(
                    [(top + 0.6 * share * wide, low), (top + share * wide, low + high)], (0.03, 0.03), tone, rng
                )


def _paint_signal_head(canvas: ThinCanvas, x: float, y: float, rng: np.random.Generator, lamps: int) -> None:
    size = float(rng.uniform(0.24, 0.36))
    wide, high = 1.05 * size, 1.05 * size * lamps
    if rng.random() < 0.35:
        canvas.box(x, y - 0.12, wide + 0.3, high + 0.24, jitter_colour(_WHITE, rng))
        canvas.box(x, y - 0.09, wide + 0.24, high + 0.18, _DARK)
    canvas.box(x, y, wide, high, jitter_colour(choose_colour((_DARK, _DARK, (44, 60, 50), (190, 160, 40)), rng), rng))
    lit = int(rng.integers(lamps))
    for lamp in range(lamps):
        colour = _LIGHTS[(0, 1, 2)[lamp] if lamps == 3 else (0, 2)[lamp % 2]]
        tone = colour if lamp == lit and rng.random() < 0.7 else (int(colour[0] * 0.25), int(colour[1] * 0.25), 24)
        canvas.disc(x, y + high - size * (lamp + 0.52), 0.4 * size, tone)


def _paint_signal(canvas: ThinCanvas, x: float, rng: np.random.Generator) -> None:
    """Paint a traffic signal: heads on a pole, some on an arm over the road."""
    arm = rng.random() < 0.3
    height = float(rng.uniform(5.0, 6.5) if arm else rng.uniform(2.8, 4.2))
    top, tone = _paint_pole(canvas, x, height, float(rng.uniform(0.09, 0.2)), rng)
    side = int(rng.choice([-1, 1]))
    if arm:
        reach = float(rng.uniform(2.5, 6.0)) * side
        canvas.tube([(top, height - 0.2), (top + reach, height + 0.1)], (0.12, 0.08), tone, rng)
        for share in (0.6, 1.0)[int(rng.integers(2)) :]:
            _paint_signal_head(canvas, top + share * reach, height - 0.5, rng, 3)
    _paint_signal_head(canvas, x + 0.2 * side * float(rng.uniform(0, 1.3)), height - 1.15, rng, 3)
    if rng.random() < 0.6:
        _paint_signal_head(canvas, x + 0.28 * side, float(rng.uniform(2.0, 2.4)), rng, int(rng.integers(2, 4)))
    if rng.random() < 0.4:
        canvas.box(x + 0.02, 1.0, 0.2, 0.3, jitter_colour((206, 176, 40), rng))


def _paint_plate(canvas: ThinCanvas, x: float, y: float, rng: np.random.Generator) -> float:
    """Paint the plate of a sign with its lower edge at y; returns its height."""
    size = float(rng.uniform(0.4, 0.9))
    red, blue = jitter_colour((186, 34, 40), rng), jitter_colour((26, 74, 150), rng)
    white, grey = jitter_colour(_WHITE, rng), jitter_colour((140, 144, 146), rng)
    yellow = jitter_colour((226, 176, 40), rng)
    match int(rng.integers(7)):
        case 0:
            canvas.disc(x, y + size / 2, size / 2, red)
            canvas.disc(x, y + size / 2, 0.39 * size, white if rng.random() < 0.7 else blue)
            mark = _DARK if rng.random() < 0.5 else red
            canvas.box(x, y + 0.42 * size, float(rng.uniform(0.1, 0.6)) * size, 0.16 * size, mark)
        case 1:
            canvas.disc(x, y + size / 2, size / 2, white)
            canvas.disc(x, y + size / 2, 0.47 * size, blue)
            canvas.tube([(x, y + 0.2 * size), (x + 0.1 * size, y + 0.8 * size)], (0.09, 0.09), white, rng)
        case 2:
            down = rng.random() < 0.4
            for share, tone in ((1.0, red), (0.68, white)):
                wide = share * size / 2
                base, tip = (y + 0.87 * size, y) if down else (y, y + 0.87 * size)
                middle = (2 * base + tip) / 3
                canvas.polygon(
                    [(x - wide, middle + (base - middle) * share), (x + wide, middle + (base - middle) * share),
                     (x, middle + (tip - middle) * share)], tone,
                )  # fmt: skip
        case 3:
            canvas.box(x, y, size, size, white)
            canvas.box(x, y + 0.04 * size, 0.92 * size, 0.92 * size, blue)
            canvas.box(x - 0.1 * size, y + 0.2 * size, 0.12 * size, 0.6 * size, white)
            canvas.disc(x + 0.05 * size, y + 0.62 * size, 0.16 * size, white)
        case 4:
            half = 0.6 * size
            canvas.polygon([(x - half, y + half), (x, y), (x + half, y + half), (x, y + 2 * half)], white)
            inner = 0.78 * half
            canvas.polygon(
                [(x - inner, y + half), (x, y + half - inner), (x + inner, y + half), (x, y + half + inner)], yellow
            )
            return 2 * half
        case 5:
            high = float(rng.uniform(0.18, 0.5))
            wide = float(rng.uniform(0.5, 1.5))
            ground = choose_colour((blue, white, yellow, grey, (36, 100, 66)), rng)
            x += float(rng.uniform(-0.4, 0.4)) * wide
            canvas.box(x, y, wide, high, ground)
            mark = white if sum(ground) < 380 else _DARK
            for row in range(1 + (high > 0.3)):
                canvas.box(x, y + high * (0.3 + 0.4 * row), float(rng.uniform(0.4, 0.85)) * wide, 0.12 * high, mark)
            return high
        case _:
            canvas.disc(x, y + size / 2, size / 2, grey)
            canvas.box(x, y + 0.45 * size, 0.7 * size, 0.06, jitter_colour((110, 112, 114), rng))
    return size


def _paint_sign(canvas: ThinCanvas, x: float, rng: np.random.Generator) -> None:
    """Paint traffic and street signs on a thin post."""
    height = float(rng.uniform(2.2, 3.8))
    _paint_pole(canvas, x, height, float(rng.uniform(0.05, 0.1)), rng, choose_colour(_METALS[:4], rng))
    y = height - float(rng.uniform(0.4, 0.9))
    for _ in range(int(rng.integers(1, 4))):
        y -= _paint_plate(canvas, x, y, rng) + 0.05
        if y < 1.2:
            break


def _paint_wires(canvas: ThinCanvas, x: float, rng: np.random.Generator) -> None:
    """Paint wires as catenaries across the view, with insulators, couplings or a hanging lamp."""
    span = max(canvas.width_m, 4.0) * float(rng.uniform(1.0, 3.0))
    start = x - span * float(rng.uniform(0.3, 0.7))
    low = canvas.bottom_m + 2.5
    y = float(rng.uniform(low, max(low + 1.0, canvas.top_m)))
    tone = jitter_colour(choose_colour(((20, 20, 22), (20, 20, 22), (70, 70, 72), (128, 126, 120)), rng), rng)
    slope = float(rng.normal(0, 0.12)) * span
    sag = float(rng.uniform(0.005, 0.05)) * span
    for _ in range(int(rng.integers(1, 6))):
        share = np.linspace(0, 1, 40)
        shape = np.cosh(3 * (share - 0.5)) / np.cosh(1.5)
        heights = y + slope * share - sag * (1 - shape) * 1.75
        line = list(zip((start + span * share).tolist(), heights.tolist(), strict=True))
        width = float(rng.choice([0.014, 0.02, 0.03, 0.05]))
        canvas.tube(line, (width, width), tone, rng)
        if rng.random() < 0.3:
            at = line[int(rng.integers(len(line)))]
            canvas.box(at[0], at[1] - 0.06, float(rng.uniform(0.1, 0.4)), 0.1, tone)
        y += float(rng.uniform(0.1, 0.6))
        slope += float(rng.normal(0, 0.02)) * span
    if rng.random() < 0.25:
        at = line[len(line) // 2]
        canvas.polygon(
            [(at[0] - 0.1, at[1]), (at[0] + 0.1, at[1]), (at[0] + 0.3, at[1] - 0.3), (at[0] - 0.3, at[1] - 0.3)], tone
        )


def _paint_bare_tree(canvas: ThinCanvas, x: float, rng: np.random.Generator) -> None:
    """Paint a tree without leaves: tapered boughs that fork at random angles down to twigs."""
    bark = jitter_colour(choose_colour(_BARKS, rng), rng)
    height, spread = float(rng.uniform(4.0, 11.0)), float(rng.uniform(0.3, 0.6))
    girth = 0.025 * height * float(rng.uniform(0.7, 1.4))
    stack = [((x, -0.3), float(rng.normal(np.pi / 2, 0.04)), 0.32 * height, girth, 0)]
    while stack:
        start, angle, length, width, depth = stack.pop()
        bend = angle + float(rng.normal(0, 0.1))
        middle = (start[0] + 0.5 * length * np.cos(angle), start[1] + 0.5 * length * np.sin(angle))
        end = (middle[0] + 0.5 * length * np.cos(bend), middle[1] + 0.5 * length * np.sin(bend))
        canvas.tube([start, middle, end], (width, 0.72 * width), bark, rng)
        if depth == 6 or width < 0.008:
            continue
        for turn in rng.normal(0, spread, int(rng.integers(2, 4))):
            # boughs turn up towards the light
            aim = bend + float(turn) + 0.12 * np.cos(bend)
            shorter, thinner = float(rng.uniform(0.6, 0.88)), float(rng.uniform(0.5, 0.75))
            stack.append((end, aim, length * shorter, width * thinner, depth + 1))


def _paint_fence(canvas: ThinCanvas, x: float, rng: np.random.Generator) -> None:
    """Paint a fence: railings, site fence of wire mesh, planks or guard rail."""
    style = rng.choice(["railing", "mesh", "planks", "rail"])
    length, high = float(rng.uniform(3.0, 14.0)), float(rng.uniform(0.9, 2.2))
    tone = jitter_colour(choose_colour((*_METALS, *_PAINTS), rng), rng)
    left = x - length / 2
    bottom = float(rng.uniform(0.0, 0.2))
    if style == "planks":
        wood = jitter_colour(choose_colour(((120, 92, 64), (90, 84, 76), (226, 226, 222), (60, 80, 64)), rng), rng)
        step = float(rng.uniform(0.1, 0.2))
        for at in np.arange(left, left + length, step):
            canvas.box(float(at), bottom, 0.9 * step, high + float(rng.normal(0, 0.01)), jitter_colour(wood, rng, 5))
        return
    posts = float(rng.uniform(1.5, 3.5))
    for at in np.arange(left, left + length + 0.01, posts):
        canvas.tube([(float(at), -0.1), (float(at), high + 0.05)], (0.06, 0.06), tone, rng)
    rails = (bottom, high) if style != "rail" else tuple(np.linspace(0.4, high, int(rng.integers(2, 4))).tolist())
    for y in rails:
        canvas.tube([(left, y), (left + length, y)], (0.05, 0.05), tone, rng)
    if style == "rail":
        return
    step = float(rng.uniform(0.09, 0.14)) if style == "railing" else 0.08
    thick = float(rng.uniform(0.014, 0.03)) if style == "railing" else 0.008
    for at in np.arange(left, left + length, step):
        canvas.tube([(float(at), bottom), (float(at), high)], (thick, thick), tone, rng)
    if style == "mesh":
        for y in np.arange(bottom, high, 0.2):
            canvas.tube([(left, float(y)), (left + length, float(y))], (thick, thick), tone, rng)


def _paint_scaffold(canvas: ThinCanvas, x: float, rng: np.random.Generator) -> None:
    """Paint a scaffold: uprights, ledgers, planks, braces, and a net in some."""
    bay, lift = float(rng.uniform(1.8, 2.8)), float(rng.uniform(1.9, 2.2))
    bays, lifts = int(rng.integers(2, 6)), int(rng.integers(2, 6))
    tone = jitter_colour(choose_colour(((158, 160, 160), (176, 150, 60), (130, 60, 44), (110, 114, 120)), rng), rng)
    wood = jitter_colour((160, 128, 88), rng)
    left, top = x - bays * bay / 2, lifts * lift
    if rng.random() < 0.3:
        net = jitter_colour(choose_colour(((220, 222, 220), (70, 120, 90), (60, 90, 130)), rng), rng)
        canvas.box(left + bays * bay / 2, 0.2, bays * bay, top, net, opacity=float(rng.uniform(0.45, 0.8)))
    for number in range(bays + 1):
        at = left + number * bay
        canvas.tube([(at, -0.2), (at, top + 1.0)], (0.055, 0.055), tone, rng)
    for level in range(1, lifts + 1):
        y = level * lift
        canvas.box(left + bays * bay / 2, y - 0.06, bays * bay + 0.2, float(rng.uniform(0.05, 0.25)), wood)
        for rise in (0.5, 1.0):
            canvas.tube([(left, y + rise), (left + bays * bay, y + rise)], (0.05, 0.05), tone, rng)
        number = int(rng.integers(bays))
        ends = [(left + number * bay, y - lift), (left + (number + 1) * bay, y)]
        canvas.tube(ends, (0.05, 0.05), tone, rng)


def _paint_parasol(canvas: ThinCanvas, x: float, rng: np.random.Generator) -> None:
    """Paint parasols of a terrace: a canopy of panels with a valance on a thin pole."""
    for number in range(int(rng.integers(1, 4))):
        at, half = x + 3.2 * number, float(rng.uniform(1.1, 2.0))
        eave, rise = float(rng.uniform(2.0, 2.5)), float(rng.uniform(0.35, 0.9))
        cloth = jitter_colour(choose_colour(_CLOTHS, rng), rng)
        canvas.tube([(at, -0.2), (at, eave + rise)], (0.06, 0.06), jitter_colour((150, 130, 100), rng), rng)
        edges = np.linspace(-half, half, 5)
        for left, right, light in zip(edges[:-1], edges[1:], (1.0, 0.92, 0.82, 0.72), strict=True):
            tone = (int(cloth[0] * light), int(cloth[1] * light), int(cloth[2] * light))
            top = 0.06 * half
            canvas.polygon(
                [
                    (at + left, eave),
                    (at + right, eave),
                    (at + right * top, eave + rise),
                    (at + left * top, eave + rise),
                ],
                tone,
            )
        dark = (int(cloth[0] * 0.7), int(cloth[1] * 0.7), int(cloth[2] * 0.7))
        canvas.box(at, eave - 0.2, 2 * half, 0.2, dark)


THIN_KINDS: Mapping[str, Callable[[ThinCanvas, float, np.random.Generator], None]] = {
    "post": _paint_post,
    "signal": _paint_signal,
    "sign": _paint_sign,
    "wire": _paint_wires,
    "bare tree": _paint_bare_tree,
    "fence": _paint_fence,
    "scaffold": _paint_scaffold,
    "parasol": _paint_parasol,
}
